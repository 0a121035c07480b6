"use strict";
// Meshes side by side with one camera: drag turns, shift-drag moves, wheel zooms, hovering shows matched vertices.
// The page has one WebGL context, however many panels; each panel is a 2D canvas that it is copied to.

const VERTEX_SHADER = `#version 300 es
in vec3 position, normal, color;
uniform mat3 turn;
uniform vec3 centre, scale;
uniform vec2 shift;
out vec3 vNormal, vColor;
void main() {
  vec3 p = turn * (position - centre);
  gl_Position = vec4(p.xy * scale.xy + shift, -p.z * scale.z, 1.0);
  vNormal = turn * normal;
  vColor = color;
}`;

const FRAGMENT_SHADER = `#version 300 es
precision highp float;
in vec3 vNormal, vColor;
out vec4 pixel;
const vec3 KEY = normalize(vec3(-0.45, 0.60, 0.66)), FILL = normalize(vec3(0.85, 0.05, 0.52));
void main() {
  vec3 n = normalize(vNormal + vec3(0.0, 0.0, 1e-9));
  if (n.z < 0.0) n = -n;
  float key = 0.74 * clamp(0.85 * dot(n, KEY) + 0.15, 0.0, 1.0);
  float light = key + 0.20 * max(dot(n, FILL), 0.0) + 0.17 + 0.06 * n.y;
  float gloss = 0.06 * pow(max(dot(n, normalize(KEY + vec3(0.0, 0.0, 1.0))), 0.0), 32.0);
  vec3 linear = pow(vColor, vec3(2.2)) * light + gloss;
  pixel = vec4(pow(clamp(linear, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);
}`;

const PLAIN = [196, 203, 214];

function decode(text, Type) {
  return new Type(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
}

function compile(gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  ["position", "normal", "color"].forEach((name, i) => gl.bindAttribLocation(program, i, name));
  gl.linkProgram(program);
  return program;
}

class Painter {
  constructor() {
    this.canvas = document.createElement("canvas");
    this.gl = this.canvas.getContext("webgl2", { antialias: true, alpha: true, premultipliedAlpha: true });
    if (!this.gl) throw new Error("no WebGL2");
    this.program = compile(this.gl);
    this.uniforms = {};
    for (const name of ["turn", "centre", "scale", "shift"]) {
      this.uniforms[name] = this.gl.getUniformLocation(this.program, name);
    }
  }

  upload(panel) {
    const gl = this.gl;
    panel.vao = gl.createVertexArray();
    gl.bindVertexArray(panel.vao);
    this.attribute(0, panel.vertices, gl.FLOAT, false);
    this.attribute(1, panel.normals, gl.FLOAT, false);
    panel.colorBuffer = this.attribute(2, panel.colors.matched, gl.UNSIGNED_BYTE, true);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, panel.faces, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
  }

  attribute(location, data, type, normalised) {
    const gl = this.gl, buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, 3, type, normalised, 0, 0);
    return buffer;
  }

  recolor(panel, mode) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, panel.colorBuffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, panel.colors[mode] || panel.colors.plain, this.gl.STATIC_DRAW);
  }

  paint(panel, frame) {
    const gl = this.gl, { width, height } = panel.canvas;
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(this.program);
    const [a, b, c] = frame.turn;
    gl.uniformMatrix3fv(this.uniforms.turn, false, [a[0], b[0], c[0], a[1], b[1], c[1], a[2], b[2], c[2]]);
    gl.uniform3fv(this.uniforms.centre, panel.centre);
    gl.uniform3f(this.uniforms.scale, 2 * frame.scale / width, 2 * frame.scale / height, 0.5 / panel.radius);
    gl.uniform2f(this.uniforms.shift, 2 * frame.x / width, -2 * frame.y / height);
    gl.bindVertexArray(panel.vao);
    gl.drawElements(gl.TRIANGLES, panel.faces.length, panel.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT, 0);
    gl.bindVertexArray(null);
    const pen = panel.canvas.getContext("2d");
    pen.clearRect(0, 0, width, height);
    pen.drawImage(this.canvas, 0, 0);
  }
}

function vertexNormals(vertices, faces) {
  const normals = new Float32Array(vertices.length);
  for (let f = 0; f < faces.length; f += 3) {
    const [i, j, k] = [3 * faces[f], 3 * faces[f + 1], 3 * faces[f + 2]];
    const u = [0, 1, 2].map((d) => vertices[j + d] - vertices[i + d]);
    const v = [0, 1, 2].map((d) => vertices[k + d] - vertices[i + d]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (const corner of [i, j, k]) for (let d = 0; d < 3; d++) normals[corner + d] += n[d];
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
    for (let d = 0; d < 3; d++) normals[i + d] /= length;
  }
  return normals;
}

// A panel as it came in the page: arrays decoded, centred, with its size across and along the upright axis.
function readPanel(data, canvas) {
  const vertices = decode(data.vertices, Float32Array);
  const faces = decode(data.faces, data.wide ? Uint32Array : Uint16Array);
  const n = vertices.length / 3, low = [Infinity, Infinity, Infinity], high = low.map((x) => -x);
  for (const i of new Set(faces)) {
    for (let d = 0; d < 3; d++) {
      low[d] = Math.min(low[d], vertices[3 * i + d]);
      high[d] = Math.max(high[d], vertices[3 * i + d]);
    }
  }
  const centre = low.map((x, d) => (x + high[d]) / 2);
  let across = 0, along = 0;
  for (let i = 0; i < n; i++) {
    const p = data.axes.map((axis) => axis.reduce((sum, a, d) => sum + a * (vertices[3 * i + d] - centre[d]), 0));
    across = Math.max(across, Math.hypot(p[0], p[2]));
    along = Math.max(along, Math.abs(p[1]));
  }
  const plain = Uint8Array.from({ length: 3 * n }, (_, i) => PLAIN[i % 3]);
  const colors = { matched: decode(data.colors, Uint8Array), plain };
  if (data.errorColors) colors.errors = decode(data.errorColors, Uint8Array);
  return {
    canvas, vertices, faces, n, centre, across, along, colors,
    label: data.label, axes: data.axes, wide: data.wide, normals: vertexNormals(vertices, faces),
    radius: Math.hypot(across, along) || 1,
    map: data.map && decode(data.map, Int32Array), errors: data.errors && decode(data.errors, Float32Array),
  };
}

class Viewer {
  constructor(root, painter) {
    const scene = JSON.parse(root.querySelector("script").textContent);
    const canvases = [...root.querySelectorAll("canvas")];
    this.root = root;
    this.painter = painter;
    this.start = scene.view;
    this.reference = scene.reference;
    this.panels = scene.panels.map((data, i) => readPanel(data, canvases[i]));
    this.readout = root.querySelector(".readout");
    this.marks = this.panels.map(() => -1);
    this.panels.forEach((panel, i) => { painter.upload(panel); this.listen(panel, i); });
    root.querySelectorAll("[data-mode]").forEach((b) => b.addEventListener("click", () => this.show(b.dataset.mode)));
    root.querySelector(".reset").addEventListener("click", () => this.reset());
    new ResizeObserver(() => this.redraw()).observe(root);
    this.reset();
    this.show("matched");
  }

  reset() {
    Object.assign(this, { azimuth: this.start.azimuth, elevation: this.start.elevation, zoom: 1, x: 0, y: 0 });
    this.redraw();
  }

  show(mode) {
    this.root.querySelectorAll("[data-mode]").forEach((b) => b.setAttribute("aria-pressed", b.dataset.mode === mode));
    const scale = this.root.querySelector(".scale");
    if (scale) scale.hidden = mode !== "errors";
    this.panels.forEach((panel) => this.painter.recolor(panel, mode));
    this.redraw();
  }

  // Rows of the rotation, pixels per unit and shift in pixels for one panel.
  frame(panel) {
    const { width, height } = panel.canvas, radians = Math.PI / 180;
    const [right, up, front] = panel.axes, a = this.azimuth * radians, e = this.elevation * radians;
    const mix = (...terms) => [0, 1, 2].map((d) => terms.reduce((sum, [w, v]) => sum + w * v[d], 0));
    const side = mix([Math.cos(a), right], [-Math.sin(a), front]);
    const level = mix([Math.cos(a), front], [Math.sin(a), right]);
    const turn = [side, mix([Math.cos(e), up], [-Math.sin(e), level]), mix([Math.cos(e), level], [Math.sin(e), up])];
    const scale = 0.47 * this.zoom * Math.min(width / (panel.across || 1), height / (panel.along || 1));
    return { turn, scale, x: this.x * width, y: this.y * height };
  }

  // Vertices in pixels of the canvas and their nearness, three numbers each.
  projected(panel, frame) {
    const { width, height } = panel.canvas, out = new Float32Array(3 * panel.n), [r, u, t] = frame.turn;
    const [cx, cy, cz] = panel.centre, v = panel.vertices;
    for (let i = 0; i < out.length; i += 3) {
      const x = v[i] - cx, y = v[i + 1] - cy, z = v[i + 2] - cz;
      out[i] = width / 2 + frame.x + frame.scale * (r[0] * x + r[1] * y + r[2] * z);
      out[i + 1] = height / 2 + frame.y - frame.scale * (u[0] * x + u[1] * y + u[2] * z);
      out[i + 2] = frame.scale * (t[0] * x + t[1] * y + t[2] * z);
    }
    return out;
  }

  redraw() {
    if (this.pending) return;
    this.pending = requestAnimationFrame(() => {
      this.pending = 0;
      const density = Math.min(window.devicePixelRatio || 1, 2);
      this.panels.forEach((panel, i) => {
        const box = panel.canvas.getBoundingClientRect();
        const width = Math.max(1, Math.round(box.width * density)), height = Math.max(1, Math.round(box.height * density));
        if (panel.canvas.width !== width || panel.canvas.height !== height) Object.assign(panel.canvas, { width, height });
        const frame = this.frame(panel);
        this.painter.paint(panel, frame);
        if (this.marks[i] >= 0) this.mark(panel, frame, this.marks[i], density);
      });
    });
  }

  // A ring around a vertex: filled if it can be seen, broken if it lies behind the surface.
  mark(panel, frame, vertex, density) {
    const points = this.projected(panel, frame), [x, y, near] = points.subarray(3 * vertex, 3 * vertex + 3);
    const hit = pick(points, panel.faces, x, y);
    const hidden = hit && hit.near > near + 0.02 * frame.scale * panel.radius;
    const pen = panel.canvas.getContext("2d");
    for (const [color, width] of [["#ffffff", 5], ["#111418", 2.5]]) {
      pen.beginPath();
      pen.arc(x, y, 7 * density, 0, 2 * Math.PI);
      pen.setLineDash(hidden ? [4 * density, 3 * density] : []);
      Object.assign(pen, { strokeStyle: color, lineWidth: width * density });
      pen.stroke();
    }
    if (hidden) return;
    pen.beginPath();
    pen.arc(x, y, 2.5 * density, 0, 2 * Math.PI);
    pen.fillStyle = "#111418";
    pen.fill();
  }

  listen(panel, index) {
    const canvas = panel.canvas;
    let last = null;
    canvas.addEventListener("pointerdown", (event) => {
      last = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
      canvas.focus({ preventScroll: true });
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { last = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (last === null) return this.hover(panel, index, event);
      const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]];
      last = [event.clientX, event.clientY];
      if (event.shiftKey || event.buttons & 6) this.move(dx / canvas.clientWidth, dy / canvas.clientHeight);
      else this.rotate(-0.5 * dx, 0.5 * dy);
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.reset());
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return; // until it is clicked, the wheel scrolls the page
      event.preventDefault();
      this.magnify(Math.exp(-0.0015 * event.deltaY));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.press(event));
  }

  press(event) {
    const keys = {
      ArrowLeft: () => this.rotate(-10, 0), ArrowRight: () => this.rotate(10, 0),
      ArrowUp: () => this.rotate(0, 10), ArrowDown: () => this.rotate(0, -10),
      "+": () => this.magnify(1.2), "-": () => this.magnify(1 / 1.2), 0: () => this.reset(),
    };
    if (!(event.key in keys)) return;
    event.preventDefault();
    keys[event.key]();
  }

  rotate(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.max(-89, Math.min(89, this.elevation + elevation));
    this.redraw();
  }

  move(dx, dy) { this.x += dx; this.y += dy; this.redraw(); }

  magnify(factor) {
    const zoom = Math.max(0.3, Math.min(40, this.zoom * factor));
    this.x *= zoom / this.zoom;
    this.y *= zoom / this.zoom;
    this.zoom = zoom;
    this.redraw();
  }

  hover(panel, index, event) {
    const box = panel.canvas.getBoundingClientRect(), density = panel.canvas.width / box.width;
    const points = this.projected(panel, this.frame(panel));
    const hit = pick(points, panel.faces, (event.clientX - box.left) * density, (event.clientY - box.top) * density);
    this.point(index, hit ? hit.vertex : -1);
  }

  // Mark a vertex of one panel and its counterparts in the others, and say what they are.
  point(index, vertex) {
    const home = this.panels[index], reference = this.panels[this.reference];
    const image = vertex < 0 ? -1 : index === this.reference ? vertex : home.map ? home.map[vertex] : -1;
    this.marks = this.panels.map((panel, i) => {
      if (i === index) return vertex;
      if (i === this.reference) return image;
      return image < 0 || !panel.map ? -1 : panel.map.indexOf(image);
    });
    this.readout.textContent = vertex < 0 ? "" : this.describe(home, reference, vertex, image);
    this.redraw();
  }

  describe(home, reference, vertex, image) {
    const name = `${home.label}: vertex ${vertex}`;
    if (home === reference) {
      const others = this.panels.filter((panel) => panel.map).map((panel) => {
        const count = panel.map.reduce((sum, v) => sum + (v === vertex), 0);
        return `${count || "no"} ${count === 1 ? "vertex" : "vertices"} of ${panel.label} mapped here`;
      });
      return [name, ...others].join(" · ");
    }
    const error = home.errors && isFinite(home.errors[vertex]) ? ` · error ${home.errors[vertex].toPrecision(3)}` : "";
    if (!home.map) return name + error;
    return `${name} → ${image < 0 ? "no counterpart" : `${reference.label}: vertex ${image}`}${error}`;
  }
}

// The nearest face under a pixel and, of its corners, the one that the pixel is closest to.
function pick(points, faces, x, y) {
  let best = null;
  for (let f = 0; f < faces.length; f += 3) {
    const [i, j, k] = [3 * faces[f], 3 * faces[f + 1], 3 * faces[f + 2]];
    const ax = points[i] - x, ay = points[i + 1] - y;
    const bx = points[j] - x, by = points[j + 1] - y, cx = points[k] - x, cy = points[k + 1] - y;
    const wa = bx * cy - by * cx, wb = cx * ay - cy * ax, wc = ax * by - ay * bx, sum = wa + wb + wc;
    if (sum === 0 || Math.min(wa * sum, wb * sum, wc * sum) < 0) continue;
    const near = (wa * points[i + 2] + wb * points[j + 2] + wc * points[k + 2]) / sum;
    if (best !== null && near <= best.near) continue;
    const weights = [wa / sum, wb / sum, wc / sum], corner = weights.indexOf(Math.max(...weights));
    best = { near, vertex: faces[f + corner] };
  }
  return best;
}

function startViewers() {
  const roots = document.querySelectorAll(".viewer");
  if (roots.length === 0) return;
  let painter;
  try {
    painter = new Painter();
  } catch (error) {
    roots.forEach((root) => {
      root.querySelector(".readout").textContent = `This browser cannot show the meshes (${error.message}).`;
    });
    return;
  }
  roots.forEach((root) => new Viewer(root, painter));
}

startViewers();
