// The box around the rods, with ticks along those of its edges that lie outside in the picture.

const LETTER = 7, LINE = 15;

class Axes {
  constructor(data, holder) {
    this.axes = data.axes;  // {name, low, high, ticks: [[position, text]]}, positions as those of the rods
    this.holder = holder;
  }

  get lines() {
    const points = [];
    this.axes.forEach((_, i) => {
      for (const [j, k] of [[0, 0], [0, 1], [1, 0], [1, 1]]) points.push(...this.on(i, this.axes[i].low, j, k), ...this.on(i, this.axes[i].high, j, k));
    });
    return points;
  }

  on(i, value, j, k) {  // a point of one of the four edges along axis i
    const x = [0, 0, 0], [one, two] = [this.axes[(i + 1) % 3], this.axes[(i + 2) % 3]];
    x[i] = value;
    x[(i + 1) % 3] = j ? one.high : one.low;
    x[(i + 2) % 3] = k ? two.high : two.low;
    return x;
  }

  label(camera, more) {  // more: [text, place, colour]
    this.holder.replaceChildren();
    const taken = [], middle = camera.project(this.axes.map((axis) => (axis.low + axis.high) / 2));
    this.axes.forEach((axis, i) => {
      if (axis.ticks.length < 2) return;
      const edges = [[0, 0], [0, 1], [1, 0], [1, 1]].map(([j, k]) => [axis.low, axis.high].map((x) => camera.project(this.on(i, x, j, k))));
      const centre = ([a, b]) => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
      // z at the left, x and y at the bottom; of equal ones the left one
      const rank = edges.map((e) => i == 2 ? -centre(e)[0] : centre(e)[1] - 1e-3 * centre(e)[0]), best = rank.indexOf(Math.max(...rank));
      const [a, b] = edges[best], length = Math.hypot(b[0] - a[0], b[1] - a[1]);
      if (length < 40) return;  // seen along the axis
      let out = [b[1] - a[1], a[0] - b[0]].map((x) => x / length);
      const [x, y] = centre(edges[best]);
      if (out[0] * (x - middle[0]) + out[1] * (y - middle[1]) < 0) out = out.map((v) => -v);
      const at = (share, away) => [a[0] + share * (b[0] - a[0]) + away * out[0], a[1] + share * (b[1] - a[1]) + away * out[1]];
      const room = Math.max(...axis.ticks.map(([, text]) => text.length)) * LETTER * Math.abs(out[0]) + LINE * Math.abs(out[1]);
      this.put(axis.name, at(.5, 18 + room + Math.abs(out[0]) * LETTER * 2), taken, "b");
      for (const [value, text] of axis.ticks)
        this.put(text, at((value - axis.low) / (axis.high - axis.low), 6 + room / 2), taken, "i");
    });
    const alike = new Map();
    for (const [text, place, colour] of more) alike.set(text, [...(alike.get(text) || []), [place, colour]]);
    for (const [text, [[place, colour], ...others]] of alike) {
      const [x, y] = camera.project(place), words = others.length ? `${text} (each of ${others.length + 1})` : text;
      // as near as there is room
      [[0, 0], [0, -1], [0, 1], [.5, 0], [-.5, 0], [.5, -1], [.5, 1], [0, -2], [0, 2], [.5, -2], [.5, 2]].some(([i, j]) =>
        this.put(words, [x + i * LETTER * words.length, y + j * LINE * 1.2], taken, "i", colour));
    }
  }

  put(text, [x, y], taken, kind, colour = "") {  // unless it overlaps a label that is there: false
    const w = text.length * LETTER + 4;
    if (taken.some((t) => Math.abs(t[0] - x) < (t[2] + w) / 2 && Math.abs(t[1] - y) < LINE)) return false;
    taken.push([x, y, w]);
    const label = document.createElement(kind);
    label.textContent = text;
    label.style.left = `${x}px`;
    label.style.top = `${y}px`;
    label.style.color = colour;
    this.holder.append(label);
    return true;
  }
}
