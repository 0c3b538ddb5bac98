// Rods by WebGL 2: their surfaces are made once, all states lie in textures, and the shader interpolates between two.
// The first texel of a node's state holds its position and a field, the second the quaternion of its directors, the
// others more fields.

const VERTEX = `#version 300 es
precision highp float; precision highp sampler2D;
in vec3 place, normal, rest;  // number of the node and the point of its section; normal along d1, d2, d3; the node at rest
uniform sampler2D states; uniform ivec2 frames; uniform float share, magnify; uniform mat4 camera; uniform mat3 turned;
uniform int field, texels; uniform vec2 range;
out vec3 across; out float value;
vec4 at(int part) {
  int i = texels * int(place.x) + part;
  vec4 one = texelFetch(states, ivec2(i, frames.x), 0), two = texelFetch(states, ivec2(i, frames.y), 0);
  return mix(one, part == 1 && dot(one, two) < 0. ? -two : two, share);
}
vec3 turn(vec4 q, vec3 v) { return v + 2. * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
void main() {
  vec4 first = at(0), q = normalize(at(1));
  gl_Position = camera * vec4(mix(rest, first.xyz, magnify) + turn(q, vec3(place.yz, 0.)), 1.);
  across = turned * turn(q, normal);
  float held = field == 0 ? first.w : at(2 + (field - 1) / 4)[max(field - 1, 0) % 4];
  value = held > 1e20 ? -1e9 : (held - range.x) / (range.y - range.x);  // no value: far below 0
}`, FRAGMENT = `#version 300 es
precision highp float;
in vec3 across; in float value; uniform sampler2D map; out vec4 colour;
void main() {
  float light = .5 + .5 * abs(normalize(across).z);
  vec3 known = texture(map, vec2(clamp(value, 0., 1.) * 255. / 256. + .5 / 256., .5)).rgb;
  colour = vec4((value < -1e3 ? vec3(.7) : known) * light, 1.);
}`, LINE_VERTEX = `#version 300 es
in vec3 point; uniform mat4 camera; void main() { gl_Position = camera * vec4(point, 1.); }`,
LINE_FRAGMENT = `#version 300 es
precision mediump float; out vec4 colour; void main() { colour = vec4(.75, .75, .75, 1.); }`, SIGN_VERTEX = `#version 300 es
in vec3 point, normal, tint; uniform mat4 camera; uniform mat3 turned; out vec3 shade;
void main() {
  gl_Position = camera * vec4(point, 1.);
  shade = tint * (.6 + .4 * abs((turned * normal).z));
}`, SIGN_FRAGMENT = `#version 300 es
precision mediump float; in vec3 shade; out vec4 colour; void main() { colour = vec4(shade, 1.); }`;

const floats = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);

class Painter {
  constructor(gl, data) {
    this.gl = gl;
    this.surface = program(gl, VERTEX, FRAGMENT);
    this.lines = program(gl, LINE_VERTEX, LINE_FRAGMENT);
    this.solids = program(gl, SIGN_VERTEX, SIGN_FRAGMENT);
    this.rods = data.rods.map((rod) => this.upload(rod, data.axis.values.length));
    this.maps = Object.fromEntries(Object.entries(data.maps).map(([name, stops]) => [name, colourMap(gl, stops)]));
    this.buffer = gl.createBuffer();
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(1, 1, 1, 1);
  }

  upload(rod, frames) {
    const gl = this.gl, { vertices, indices } = surface(rod), holder = gl.createVertexArray();
    gl.bindVertexArray(holder);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.STATIC_DRAW);
    this.attributes(this.surface, ["place", "normal", "rest"]);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    const states = texture(gl, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, rod.texels * rod.nodes, frames, 0, gl.RGBA, gl.FLOAT, floats(rod.states));
    return { holder, count: indices.length, states, texels: rod.texels };
  }

  attributes(program, names) {  // vectors that lie one after the other in the buffer
    const gl = this.gl;
    names.forEach((name, k) => {
      const where = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(where);
      gl.vertexAttribPointer(where, 3, gl.FLOAT, false, 12 * names.length, 12 * k);
    });
  }

  // camera: 4 x 4 and 3 x 3 matrices, column by column; field: {channel, map, low, high}; magnify: factor of
  // displacements; lines: pairs of points; solids: corners of triangles with normals and colours
  draw(camera, turned, { frames, share }, field, magnify, lines, solids) {
    const gl = this.gl, at = (name) => gl.getUniformLocation(this.surface, name);
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.lines);
    gl.uniformMatrix4fv(gl.getUniformLocation(this.lines, "camera"), false, camera);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(lines), gl.DYNAMIC_DRAW);
    this.attributes(this.lines, ["point"]);
    gl.drawArrays(gl.LINES, 0, lines.length / 3);
    gl.useProgram(this.solids);
    gl.uniformMatrix4fv(gl.getUniformLocation(this.solids, "camera"), false, camera);
    gl.uniformMatrix3fv(gl.getUniformLocation(this.solids, "turned"), false, turned);
    gl.bufferData(gl.ARRAY_BUFFER, solids, gl.DYNAMIC_DRAW);
    this.attributes(this.solids, ["point", "normal", "tint"]);
    gl.drawArrays(gl.TRIANGLES, 0, solids.length / 9);
    gl.useProgram(this.surface);
    gl.uniformMatrix4fv(at("camera"), false, camera);
    gl.uniformMatrix3fv(at("turned"), false, turned);
    gl.uniform2iv(at("frames"), frames);
    gl.uniform1f(at("share"), share);
    gl.uniform1f(at("magnify"), magnify);
    gl.uniform1i(at("field"), field.channel);
    gl.uniform2f(at("range"), field.low, field.high);
    gl.uniform1i(at("states"), 0);
    gl.uniform1i(at("map"), 1);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.maps[field.map]);
    gl.activeTexture(gl.TEXTURE0);
    for (const rod of this.rods) {
      gl.uniform1i(at("texels"), rod.texels);
      gl.bindTexture(gl.TEXTURE_2D, rod.states);
      gl.bindVertexArray(rod.holder);
      gl.drawElements(gl.TRIANGLES, rod.count, gl.UNSIGNED_INT, 0);
    }
    gl.bindVertexArray(null);
  }
}

// The surface of a rod, its edges sharp where the outline of the section has corners, closed at both ends.
function surface(rod) {
  const outline = floats(rod.outline), rest = floats(rod.rest), at = (node) => rest.slice(3 * node, 3 * node + 3), c = rod.corners, varies = outline.length > 2 * c, vertices = [], indices = [];
  const corner = (node, i) => {
    const k = 2 * ((varies ? node * c : 0) + (i + c) % c);
    return [outline[k], outline[k + 1]];
  };
  const edge = (node, i) => {  // unit normal of the edge from corner i to the next
    const [a, b] = [corner(node, i), corner(node, i + 1)], [x, y] = [b[1] - a[1], a[0] - b[0]], size = Math.hypot(x, y) || 1;
    return [x / size, y / size];
  };
  const smooth = (node, i, other) => {
    const [a, b] = [edge(node, i), edge(node, other)];
    if (a[0] * b[0] + a[1] * b[1] < .8) return a;
    const [x, y] = [a[0] + b[0], a[1] + b[1]], size = Math.hypot(x, y);
    return [x / size, y / size];
  };
  for (let node = 0; node < rod.nodes; node++)
    for (let i = 0; i < c; i++) {
      vertices.push(node, ...corner(node, i), ...smooth(node, i, i - 1), 0, ...at(node));
      vertices.push(node, ...corner(node, i + 1), ...smooth(node, i, i + 1), 0, ...at(node));
    }
  for (let node = 0; node + 1 < rod.nodes; node++)
    for (let i = 0; i < c; i++) {
      const a = 2 * (node * c + i), b = a + 2 * c;
      indices.push(a, a + 1, b, a + 1, b + 1, b);
    }
  for (const [node, normal] of [[0, -1], [rod.nodes - 1, 1]]) {
    const first = vertices.length / 9;
    for (let i = 0; i < c; i++) vertices.push(node, ...corner(node, i), 0, 0, normal, ...at(node));
    for (let i = 1; i + 1 < c; i++) indices.push(first, first + i, first + i + 1);
  }
  return { vertices: new Float32Array(vertices), indices: new Uint32Array(indices) };
}

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return made;
}

function texture(gl, filter) {
  const made = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, made);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, filter);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  return made;
}

// 256 colours between evenly spaced ones, as the colour bar's CSS gradient has them.
function colourMap(gl, stops) {
  const parts = stops.map((text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16))), made = texture(gl, gl.LINEAR);
  const pixels = Uint8Array.from({ length: 1024 }, (_, k) => {
    const x = Math.floor(k / 4) / 255 * (stops.length - 1), i = Math.min(Math.floor(x), stops.length - 2), j = k % 4;
    return j == 3 ? 255 : Math.round(parts[i][j] + (x - i) * (parts[i + 1][j] - parts[i][j]));
  });
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return made;
}
