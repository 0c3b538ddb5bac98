// A parallel projection that turns about the middle of the box; z points upwards. Positions are those of the data.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const margin = () => innerWidth < 600 ? { left: 70, right: 95, top: 160, bottom: 140 } : { left: 100, right: 170, top: 80, bottom: 110 };

class Camera {
  constructor(box, view) {
    this.first = view;
    this.corners = [...Array(8).keys()].map((k) => [0, 1, 2].map((i) => box[k >> i & 1][i]));
    this.reset();
  }

  reset() {
    [this.yaw, this.pitch] = this.first;
    this.zoom = 1;
    this.pan = [0, 0];
  }

  get axes() {  // unit vectors to the right, upwards and to the viewer
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    return [[-sy, cy, 0], [-sp * cy, -sp * sy, cp], [cp * cy, cp * sy, sp]];
  }

  // Pixels per unit of length: the box fills the window in the first view.
  get scale() {
    const now = [this.yaw, this.pitch];
    [this.yaw, this.pitch] = this.first;
    const spans = this.axes.map((a) => Math.max(...this.corners.map((x) => dot(a, x))) - Math.min(...this.corners.map((x) => dot(a, x))));
    [this.yaw, this.pitch] = now;
    const m = margin(), wide = Math.max(innerWidth - m.left - m.right, 80), high = Math.max(innerHeight - m.top - m.bottom, 80);
    return this.zoom * Math.min(wide / Math.max(spans[0], 1e-9), high / Math.max(spans[1], 1e-9));
  }

  get centre() {
    const m = margin();
    return [(innerWidth + m.left - m.right) / 2 + this.pan[0], (innerHeight + m.top - m.bottom) / 2 + this.pan[1]];
  }

  project(x) {  // to pixels from the upper left corner
    const [right, up] = this.axes, s = this.scale, [left, top] = this.centre;
    return [left + s * dot(right, x), top - s * dot(up, x)];
  }

  turn(dx, dy) {
    this.yaw -= dx / 150;
    this.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, this.pitch + dy / 150));
  }

  move(dx, dy) {
    this.pan = [this.pan[0] + dx, this.pan[1] + dy];
  }

  zoomAt(factor, x, y) {  // the point under (x, y) stays there
    const before = this.zoom;
    this.zoom = Math.max(.05, Math.min(500, this.zoom * factor));
    const [left, top] = this.centre, f = 1 - this.zoom / before;
    this.move(f * (x - left), f * (y - top));
  }

  // Matrices for the shaders, column by column; the depth holds the box at every angle.
  matrices() {
    const [r, u, f] = this.axes, s = this.scale, [left, top] = this.centre, a = 2 * s / innerWidth, b = 2 * s / innerHeight;
    const x = 2 * left / innerWidth - 1, y = 1 - 2 * top / innerHeight;
    return {
      camera: [a * r[0], b * u[0], -f[0] / 4, 0, a * r[1], b * u[1], -f[1] / 4, 0, a * r[2], b * u[2], -f[2] / 4, 0, x, y, 0, 1],
      turned: [r[0], u[0], f[0], r[1], u[1], f[1], r[2], u[2], f[2]],
    };
  }
}

// Turn, move and zoom by mouse, touch and wheel.
function steer(canvas, camera, changed) {
  const down = new Map(), spread = (p) => Math.hypot(p[0][0] - p[1][0], p[0][1] - p[1][1]);
  const middle = (p) => [(p[0][0] + p[1][0]) / 2, (p[0][1] + p[1][1]) / 2];
  canvas.addEventListener("pointerdown", (e) => {
    canvas.setPointerCapture(e.pointerId);
    down.set(e.pointerId, [e.clientX, e.clientY]);
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (e) => down.delete(e.pointerId));
  canvas.addEventListener("pointermove", (e) => {
    if (!down.has(e.pointerId)) return;
    const before = [...down.values()], [x, y] = down.get(e.pointerId), [dx, dy] = [e.clientX - x, e.clientY - y];
    down.set(e.pointerId, [e.clientX, e.clientY]);
    if (down.size == 2) {
      const now = [...down.values()], [from, to] = [middle(before), middle(now)];
      camera.move(to[0] - from[0], to[1] - from[1]);
      camera.zoomAt(spread(now) / Math.max(spread(before), 1), ...to);
    } else if (e.shiftKey || e.buttons & 6) camera.move(dx, dy);
    else camera.turn(dx, dy);
    changed();
  });
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    camera.zoomAt(Math.exp(-e.deltaY * (e.deltaMode ? 20 : 1) / 600), e.clientX, e.clientY);
    changed();
  }, { passive: false });
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
}
