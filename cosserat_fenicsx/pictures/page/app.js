// The slider, the play button, the colour bar, and one drawing per frame of the screen.

const $ = (name) => document.getElementById(name);
const data = JSON.parse($("data").textContent), values = data.axis.values, last = values.length - 1;
$("title").textContent = data.title;
const notes = (magnify) => [...data.notes, ...(magnify == 1 ? [] : [`displacements magnified ${magnify} times`])].join("; ");
$("note").textContent = notes(data.magnify.start);
const gl = $("picture").getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
if (!gl) $("note").textContent = "This browser offers no WebGL 2, which the picture needs.";

// Positions of the slider: the time, or along a path the number of the point, since load factors may repeat.
const timed = data.axis.timed, from = timed ? values[0] : 0, to = timed ? values[last] : last;

function at(x) {  // the two states around a position of the slider, and the share of the way between them
  let k = Math.min(Math.max(Math.floor(x), 0), Math.max(last - 1, 0));
  if (timed) for (k = Math.max(last - 1, 0); k > 0 && values[k] > x; ) k--;
  const next = Math.min(k + 1, last), share = timed ? (x - values[k]) / (values[next] - values[k] || 1) : x - k;
  return { frames: [k, next], share: Math.min(Math.max(share, 0), 1) };
}

const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"], [1e-12, "p"], [1e-15, "f"]];

function ticks(low, high) {  // round numbers between two limits
  const raw = (high - low) / 6, decade = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].find((f) => f * decade >= raw * .999) * decade;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const first = Math.ceil(low / step - 1e-9), count = Math.floor(high / step + 1e-9) - first + 1;
  return [...Array(count).keys()].map((k) => [(first + k) * step, ((first + k) * step).toFixed(digits).replace(/^-(0\.?0*)$/, "$1")]);
}

// Size and name of the unit for a value in an SI unit: the one that was asked for, or with a prefix that suits the value.
function suited(value, unit) {
  const [size, prefix] = (unit.match(/^(N|m|Pa)/) && PREFIXES.find(([s]) => value >= s * (1 - 1e-9))) || [1, ""];
  return data.units[unit] || [size, unit == "1" ? "" : prefix + unit];
}

function bar(field) {
  const [scale, unit] = suited(field.peak, field.unit);
  $("unit").textContent = `at most ${+(field.peak / scale).toPrecision(3)} ${unit}`;
  $("map").style.background = `linear-gradient(to top, ${data.maps[field.map]})`;
  $("numbers").replaceChildren(...(field.peak > 0 ? ticks(field.low / scale, field.high / scale) : [[0, "0"]]).map(([value, text]) => {
    const span = document.createElement("span");
    span.textContent = text;
    span.style.bottom = `${100 * (value * scale - field.low) / (field.high - field.low)}%`;
    return span;
  }));
}

if (gl) {
  const painter = new Painter(gl, data), camera = new Camera(data.box, data.view), axes = new Axes(data, $("labels")), signs = new Signs(data);
  let now = to, playing = false, before = null, waiting = false, field = data.fields[0], magnify = data.magnify.start;

  function draw() {
    waiting = false;
    const ratio = devicePixelRatio || 1;
    [gl.canvas.width, gl.canvas.height] = [innerWidth * ratio, innerHeight * ratio];
    const { camera: matrix, turned } = camera.matrices(), place = at(now);
    const { vertices, labels } = $("signs").checked ? signs.build(place, magnify, data.box) : { vertices: new Float32Array(), labels: [] };
    painter.draw(matrix, turned, place, field, magnify, [...axes.lines, ...signs.resting], vertices);
    axes.label(camera, labels);
    const [k, next] = place.frames, value = values[k] + place.share * (values[next] - values[k]), shown = place.share < .5 ? k : next;
    const number = timed ? value.toFixed(data.axis.digits) : +value.toPrecision(4);
    $("now").textContent = `${data.axis.name} ${number}${data.axis.unit}${data.axis.stable[shown] ? "" : " (unstable)"}`;
    $("slider").value = now;
  }
  const changed = () => { if (!waiting) requestAnimationFrame(draw); waiting = true; };

  function step(time) {
    if (!playing) return;
    now += (to - from) * (before === null ? 0 : Math.min(time - before, 100)) / 1000 / data.axis.seconds;
    if (now > to) now = from;
    before = time;
    draw();
    requestAnimationFrame(step);
  }
  function play(on) {
    [playing, before] = [on && last > 0, null];
    $("play").textContent = playing ? "stop" : "play";
    if (playing && now >= to) now = from;
    if (playing) requestAnimationFrame(step);
  }

  Object.assign($("slider"), { min: from, max: to, step: (to - from) / 1000 || 1, value: now, disabled: last == 0 });
  $("slider").setAttribute("aria-label", data.axis.name);
  $("play").disabled = last == 0;
  $("slider").addEventListener("input", (e) => { play(false); now = +e.target.value; changed(); });
  $("play").addEventListener("click", () => play(!playing));
  $("reset").addEventListener("click", () => { camera.reset(); changed(); });
  addEventListener("keydown", (e) => {
    if (e.key != " " || /BUTTON|SELECT/.test(e.target.tagName)) return;
    e.preventDefault();
    play(!playing);
  });
  for (const [i, one] of data.fields.entries()) $("field").add(new Option(one.words, i));
  $("field").addEventListener("change", (e) => { field = data.fields[e.target.value]; bar(field); changed(); });
  for (const factor of data.magnify.choices) $("magnify").add(new Option(`${factor} ×`, factor, false, factor == magnify));
  $("magnify").addEventListener("change", (e) => { magnify = +e.target.value; $("note").textContent = notes(magnify); changed(); });
  $("signs").addEventListener("change", changed);
  steer(gl.canvas, camera, changed);
  addEventListener("resize", changed);
  bar(field);
  draw();
}
