// Supports, joints and loads: solids that are made anew for every picture, at the sections that they belong to.

const SIDES = 14, plus = (a, b, f = 1) => a.map((x, i) => x + f * b[i]), times = (f, a) => a.map((x) => f * x);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a) => Math.hypot(...a), unit = (a) => times(1 / (length(a) || 1), a);

function turn([w, ...v], x) {  // a vector turned by a quaternion
  const t = plus(cross(v, x), x, w);
  return plus(x, cross(v, t), 2);
}

class Solids {
  constructor() {
    this.vertices = [];  // place, normal and colour of the corners of triangles
  }

  corner(place, normal) { this.vertices.push(...place, ...normal, ...this.colour); }

  // The surface around an axis of a profile [[along the axis, radius] ...].
  revolve(base, axis, profile) {
    const one = unit(cross(axis, Math.abs(axis[2]) < .9 ? [0, 0, 1] : [1, 0, 0])), other = cross(axis, one);
    const out = (k) => plus(times(Math.cos(2 * Math.PI * k / SIDES), one), other, Math.sin(2 * Math.PI * k / SIDES));
    profile.slice(1).forEach(([b, s], i) => {
      const [a, r] = profile[i], size = Math.hypot(b - a, s - r) || 1;
      for (let k = 0; k < SIDES; k++) {
        const rings = [k, k + 1].map((j) => {
          const away = out(j), normal = plus(times((b - a) / size, away), axis, (r - s) / size);
          return [plus(plus(base, axis, a), away, r), plus(plus(base, axis, b), away, s), normal];
        });
        const [[p, q, m], [u, v, n]] = rings;
        for (const [place, normal] of [[p, m], [q, m], [u, n], [q, m], [v, n], [u, n]]) this.corner(place, normal);
      }
    });
  }

  tube(from, to, radius) {
    const along = plus(to, from, -1), size = length(along);
    if (size > 0) this.revolve(from, unit(along), [[0, 0], [0, radius], [size, radius], [size, 0]]);
  }

  ball(place, radius) {
    const arc = [...Array(9).keys()].map((k) => [-radius * Math.cos(Math.PI * k / 8), radius * Math.sin(Math.PI * k / 8)]);
    this.revolve(place, [0, 0, 1], arc);
  }

  cone(tip, along, height, radius) { this.revolve(plus(tip, along, -height), along, [[0, 0], [0, radius], [height, 0]]); }

  box(middle, axes, halves) {
    axes.forEach((axis, i) => [-1, 1].forEach((side) => {
      const [u, v] = [1, 2].map((k) => times(halves[(i + k) % 3], axes[(i + k) % 3])), face = plus(middle, axis, side * halves[i]);
      const at = (a, b) => plus(plus(face, u, a), v, b);
      for (const place of [at(-1, -1), at(1, -1), at(1, 1), at(-1, -1), at(1, 1), at(-1, 1)]) this.corner(place, times(side, axis));
    }));
  }

  plate(middle, down, size) {
    const one = unit(cross(down, Math.abs(down[0]) < .9 ? [1, 0, 0] : [0, 1, 0]));
    this.box(middle, [one, cross(down, one), down], [.55 * size, .55 * size, .05 * size]);
  }

  arrow(start, along, size, a, heads = 1) {
    const head = Math.min(.5 * a, .6 * size);
    this.tube(start, plus(start, along, size - head), .06 * a);
    for (let k = 0; k < heads; k++) this.cone(plus(start, along, size - .8 * k * head), along, head, .17 * a);
  }
}

class Signs {
  constructor(data) {
    this.data = data;
    this.rods = data.rods.map((rod) => ({ ...rod, states: floats(rod.states), rest: floats(rod.rest) }));
    this.signs = data.signs.map((sign) => ({ ...sign, vectors: sign.vectors && floats(sign.vectors), colour: [1, 3, 5].map((i) => parseInt(sign.colour.slice(i, i + 2), 16) / 255), css: sign.colour }));
    // the rods at rest, as pairs of points
    this.resting = this.rods.flatMap(({ rest, nodes }) => [...Array(nodes - 1).keys()].flatMap((k) => [...rest.slice(3 * k, 3 * k + 6)]));
  }

  // Place, quaternion of the directors and tangent of a section, between the nodes of the rod.
  pose(rod, at, { frames, share }, magnify) {
    const { states, rest, nodes, texels } = this.rods[rod], k = Math.min(Math.floor(at), nodes - 2), x = at - k;
    const node = (j, frame, from, to) => [...states.slice(4 * texels * (frame * nodes + j) + from, 4 * texels * (frame * nodes + j) + to)];
    const mix = (a, b, f) => plus(times(1 - f, a), b, f), near = (q, p) => q.reduce((sum, y, i) => sum + y * p[i], 0) < 0 ? times(-1, p) : p;
    const now = (j) => mix(node(j, frames[0], 0, 3), node(j, frames[1], 0, 3), share);
    const q = (j) => { const one = node(j, frames[0], 4, 8); return mix(one, near(one, node(j, frames[1], 4, 8)), share); };
    const still = (j) => [...rest.slice(3 * j, 3 * j + 3)], moved = (j) => mix(still(j), now(j), magnify);
    const turned = q(k);
    return { place: mix(moved(k), moved(k + 1), x), q: unit(mix(turned, near(turned, q(k + 1)), x)), radius: this.data.radii[rod] };
  }

  vector(sign, k, { frames, share }, count) {
    const of = (frame) => [...sign.vectors.slice(3 * (frame * count + k), 3 * (frame * count + k) + 3)];
    return plus(times(1 - share, of(frames[0])), of(frames[1]), share);
  }

  // The corners of all triangles, and labels [text, place, colour].
  build(where, magnify, box) {
    const solids = new Solids(), labels = [];
    for (const sign of this.signs) {
      solids.colour = sign.colour;
      const count = (sign.at || [0]).length;
      if (sign.kind == "everywhere") this.everywhere(solids, labels, sign, where, box);
      else if (sign.kind.startsWith("line")) this.along(solids, labels, sign, where, magnify, count);
      else {
        const pose = this.pose(sign.rod, sign.at[0], where, magnify), tangent = turn(pose.q, [0, 0, 1]);
        const inwards = sign.end ? times(-sign.end, tangent) : null;
        if (sign.vectors) this.load(solids, labels, sign, where, pose, inwards);
        else this.support(solids, sign, pose, tangent, inwards);
      }
    }
    return { vertices: new Float32Array(solids.vertices), labels };
  }

  support(solids, sign, { place, q, radius }, tangent, inwards) {
    const a = this.data.size, axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((x) => turn(q, x)), kind = sign.kind;
    if (kind == "clamp" || kind == "moved") {
      const half = Math.max(.6 * a, 1.3 * radius);
      return solids.box(inwards ? plus(place, inwards, -.17 * a) : place, axes, [half, half, .17 * a]);
    }
    if (kind.endsWith("joint")) {
      solids.ball(place, (kind == "joint" ? 1.25 : 1.7) * sign.girth);
      const reach = Math.max(.45 * a, 2.5 * sign.girth);
      if (kind == "hinge joint") solids.tube(plus(place, turn(q, sign.axis), -reach), plus(place, turn(q, sign.axis), reach), .9 * sign.girth);
      return;
    }
    if (kind == "mass") return solids.ball(place, Math.max(.3 * a, 2 * radius));
    if (kind == "turning spring") {
      const spiral = [...Array(61).keys()].map((k) => [radius + .2 * a * k / 15, Math.PI * k / 12]);
      const points = spiral.map(([r, angle]) => plus(plus(place, this.data.right, r * Math.cos(angle)), this.data.up, r * Math.sin(angle)));
      return points.slice(1).forEach((point, i) => solids.tube(points[i], point, .05 * a));
    }
    const down = this.below(sign, tangent, inwards);
    if (kind == "pin" || kind == "hinge" || kind == "roller") {
      const top = plus(place, down, inwards && dot(down, inwards) < -1e-6 ? 0 : .7 * sign.girth), foot = plus(top, down, .75 * a);
      solids.cone(top, times(-1, down), .75 * a, .42 * a);
      const across = unit(cross(down, Math.abs(dot(down, tangent)) < .9 ? tangent : this.data.right)), reach = Math.max(.5 * a, 2 * sign.girth);
      if (kind == "hinge") solids.tube(plus(place, sign.axis, -reach), plus(place, sign.axis, reach), 1.5 * sign.girth + .08 * a);
      if (kind == "roller") for (const side of [-.25, .25]) solids.ball(plus(plus(foot, down, .12 * a), across, side * a), .12 * a);
      return solids.plate(plus(foot, down, (kind == "roller" ? .29 : .05) * a), down, a);
    }
    const end = plus(place, down, 1.6 * a), across = unit(cross(down, this.data.right[0] > .9 ? [0, 1, 0] : [1, 0, 0]));
    const y = kind == "dashpot" ? [0, 0] : [0, 0, 1, -1, 1, -1, 0, 0], x = kind == "dashpot" ? [0, 1] : [0, .25, .32, .45, .58, .71, .78, 1];
    const points = x.map((share, i) => plus(plus(place, down, 1.6 * a * share), across, .25 * a * y[i]));
    points.slice(1).forEach((point, i) => solids.tube(points[i], point, .05 * a));
    if (kind == "dashpot") solids.tube(plus(place, down, .56 * a), plus(place, down, 1.36 * a), .22 * a);
    solids.plate(plus(end, down, .05 * a), down, a);
  }

  below(sign, tangent, inwards) {
    const { up, right } = this.data;
    if (sign.axis && sign.kind != "hinge") return unit(times(dot(sign.axis, plus(up, right, .01)) > 0 ? -1 : 1, sign.axis));
    if (inwards && dot(inwards, up) < -.7) return up;
    if (!inwards && Math.abs(dot(tangent, up)) > .7) return right;
    return times(-1, up);
  }

  load(solids, labels, sign, where, { place, q, radius }, inwards) {
    let vector = this.vector(sign, 0, where, 1);
    const share = length(vector), a = this.data.size;
    if (share < 1e-9) return;
    if (sign.turns) vector = turn(q, vector);
    const along = unit(vector), size = a * Math.max(.9, 1.9 * Math.sqrt(share)), pulls = inwards && dot(along, inwards) < -.3;
    let gap = radius;
    if (sign.arm) {
      const foot = plus(place, turn(q, sign.arm));
      solids.tube(place, foot, .05 * a);
      [place, gap] = [foot, 0];
    }
    if (sign.kind == "force") {
      const start = plus(place, along, pulls ? gap : -gap - size);
      solids.arrow(start, along, size, a);
      return labels.push([this.words(sign, share), plus(start, along, pulls ? size + .5 * a : -.5 * a), sign.css]);
    }
    const one = unit(cross(along, Math.abs(along[2]) < .9 ? [0, 0, 1] : [1, 0, 0])), other = cross(along, one), r = Math.max(.95 * a, 2.2 * radius);
    const arc = [...Array(25).keys()].map((k) => {
      const angle = Math.PI * (.25 + 1.5 * k / 24);
      return plus(plus(place, one, r * Math.cos(angle)), other, r * Math.sin(angle));
    });
    arc.slice(1).forEach((point, k) => solids.tube(arc[k], point, .05 * a));
    const ahead = unit(plus(arc[24], arc[23], -1));
    solids.cone(plus(arc[24], ahead, .3 * a), ahead, .45 * a, .17 * a);
    labels.push([this.words(sign, share), plus(place, plus(arc[8], place, -1), 1 + .6 * a / r), sign.css]);
  }

  along(solids, labels, sign, where, magnify, count) {
    const a = this.data.size;
    let largest = 0, label = null;
    sign.at.forEach((at, k) => {
      const { place, q, radius } = this.pose(sign.rod, at, where, magnify), tangent = turn(q, [0, 0, 1]);
      let vector = this.vector(sign, k, where, count);
      const share = length(vector);
      if (share < .02) return;
      const along = unit(vector), size = a * Math.max(share, .35), beside = Math.abs(dot(along, tangent)) > .8;
      const start = beside ? plus(plus(place, along, -size / 2), unit(cross(along, this.data.up[2] && Math.abs(along[2]) > .8 ? this.data.right : this.data.up)), radius + .3 * a) : plus(place, along, -size - radius);
      solids.arrow(start, along, size, .6 * a, sign.kind == "line moment" ? 2 : 1);
      if (share > largest) [largest, label] = [share, plus(start, along, -.4 * a)];
    });
    if (label) labels.push([this.words(sign, largest), label, sign.css]);
  }

  everywhere(solids, labels, sign, where, [low, high]) {
    const vector = this.vector(sign, 0, where, 1), a = this.data.size;
    if (length(vector) < 1e-9) return;
    const { right, up } = this.data, corner = plus(right, up).map((x, i) => x < 0 ? low[i] : high[i]);
    const along = unit(vector), start = plus(plus(corner, right, 2.5 * a), up, -1.5 * a);
    solids.arrow(start, along, 1.9 * a, a);
    labels.push([sign.text, plus(start, along, -.5 * a), sign.css]);
  }

  words(sign, share) {
    const value = share * sign.top, [scale, unit] = suited(value, sign.unit);
    return `${+(value / scale).toPrecision(3)} ${unit}${sign.turns ? " (follows)" : ""}`;
  }
}
