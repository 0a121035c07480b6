// One WebGL context for the whole page, however many meshes: each panel is a 2D canvas that it is copied to.

class Painter {
  constructor(antialias) {
    this.canvas = document.createElement("canvas");
    this.gl = this.canvas.getContext("webgl2", { antialias, alpha: true, premultipliedAlpha: true });
    if (!this.gl) throw new Error("it has no WebGL 2");
    this.generation = 0; // how often the context was made; what was uploaded to an earlier one is gone
    this.start();
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault()); // asks for a new one
    this.canvas.addEventListener("webglcontextrestored", () => { this.start(); this.restored?.(); });
  }

  start() {
    this.generation += 1;
    this.surface = this.program(SURFACE_VERTEX, SURFACE_FRAGMENT, ["pattern", "density"]);
    this.numbers = this.program(NUMBER_VERTEX, NUMBER_FRAGMENT, []);
    this.target = null;
  }

  program(vertex, fragment, uniforms) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ATTRIBUTES.forEach((name, i) => gl.bindAttribLocation(program, i, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      const logs = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(logs.join(" ") || gl.getProgramInfoLog(program));
    }
    const places = {};
    for (const name of ["turn", "centre", "scale", "shift", ...uniforms]) places[name] = gl.getUniformLocation(program, name);
    return { program, places };
  }

  upload(mesh) {
    const gl = this.gl;
    mesh.vao = gl.createVertexArray();
    gl.bindVertexArray(mesh.vao);
    this.attribute(0, mesh.vertices, 3, gl.FLOAT);
    this.attribute(1, mesh.normals, 3, gl.FLOAT);
    mesh.colorBuffer = this.attribute(2, mesh.colors, 4, gl.UNSIGNED_BYTE);
    this.attribute(3, mesh.places, 3, gl.FLOAT);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.faces, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    mesh.generation = this.generation;
    mesh.repaint = false;
  }

  attribute(location, data, size, type) {
    const gl = this.gl, buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, size, type, type === gl.UNSIGNED_BYTE, 0, 0);
    return buffer;
  }

  draw(mesh, frame, { program, places }) {
    const gl = this.gl, { width, height } = frame;
    if (mesh.generation !== this.generation) this.upload(mesh);
    if (mesh.repaint) {
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.colorBuffer);
      gl.bufferData(gl.ARRAY_BUFFER, mesh.colors, gl.STATIC_DRAW);
      mesh.repaint = false;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    const [a, b, c] = frame.turn;
    gl.uniformMatrix3fv(places.turn, false, [a[0], b[0], c[0], a[1], b[1], c[1], a[2], b[2], c[2]]);
    gl.uniform3fv(places.centre, mesh.centre);
    gl.uniform3f(places.scale, 2 * frame.scale / width, 2 * frame.scale / height, 0.5 / mesh.radius);
    gl.uniform2f(places.shift, 2 * frame.x / width, -2 * frame.y / height);
    gl.uniform1i(places.pattern ?? null, frame.pattern);
    gl.uniform1f(places.density ?? null, frame.density);
    gl.bindVertexArray(mesh.vao);
    gl.drawElements(gl.TRIANGLES, mesh.faces.length, mesh.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT, 0);
    gl.bindVertexArray(null);
  }

  // Paint a mesh into a 2D canvas of the frame's size.
  paint(mesh, frame, canvas) {
    const { width, height } = frame, own = this.canvas;
    if (own.width < width) own.width = width; // it only grows: the panels of a page differ in size
    if (own.height < height) own.height = height;
    this.draw(mesh, frame, this.surface);
    const pen = canvas.getContext("2d");
    pen.clearRect(0, 0, width, height);
    pen.drawImage(own, 0, own.height - height, width, height, 0, 0, width, height);
  }

  // For every pixel, rows from the bottom, the number plus one of some corner of the face that is seen there, or 0.
  read(mesh, frame) {
    const gl = this.gl, { width, height } = frame, numbers = new Uint8Array(4 * width * height);
    this.prepare(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target.framebuffer);
    this.draw(mesh, frame, this.numbers);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, numbers);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return new Uint32Array(numbers.buffer);
  }

  // Make the picture that numbers are drawn to at least this large.
  prepare(width, height) {
    if (this.target && this.target.width >= width && this.target.height >= height) return;
    const gl = this.gl, old = this.target;
    if (old) { gl.deleteFramebuffer(old.framebuffer); gl.deleteRenderbuffer(old.color); gl.deleteRenderbuffer(old.depth); }
    width = Math.max(width, old ? old.width : 0);
    height = Math.max(height, old ? old.height : 0);
    const framebuffer = gl.createFramebuffer(), color = gl.createRenderbuffer(), depth = gl.createRenderbuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.bindRenderbuffer(gl.RENDERBUFFER, color);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, color);
    gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
    this.target = { framebuffer, color, depth, width, height };
  }
}
