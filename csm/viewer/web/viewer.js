// Meshes side by side with one camera, and what is hovered, pinned and shown of them.

class Viewer {
  constructor(root, painter) {
    const scene = JSON.parse(root.querySelector("script").textContent);
    const canvases = [...root.querySelectorAll("canvas")];
    Object.assign(this, { root, painter, reference: scene.reference, steps: scene.steps, hovered: null, pinned: null });
    this.camera = new Camera(scene.view);
    this.scales = scene.scales;
    for (const scale of Object.values(this.scales)) scale.ramp = decode(scale.ramp, Uint8Array);
    this.panels = scene.panels.map((data, i) => ({
      mesh: readMesh(data), canvas: canvases[i], view: canvases[i].parentElement, stale: true,
    }));
    const to = this.panels[this.reference].mesh;
    for (const { mesh } of this.panels) {
      mesh.places = mesh.map ? placesOn(to, mesh.map, mesh.n) : placesOn(mesh, null, mesh.n);
    }
    const buttons = [...root.querySelectorAll("[data-mode]")];
    this.modes = buttons.map((button) => button.dataset.mode);
    buttons.forEach((button) => button.addEventListener("click", () => this.show(button.dataset.mode)));
    root.querySelector(".reset").addEventListener("click", () => this.reset());
    this.panels.forEach((panel, i) => listenToPointers(this, panel, i));
    listenToKeys(this);
    new ResizeObserver(() => this.turned()).observe(root.querySelector(".panels"));
    this.show(this.modes[0]);
  }

  reset() { this.camera.reset(); this.turned(); }

  turned() {
    this.panels.forEach((panel) => { panel.stale = true; });
    this.redraw();
  }

  show(mode) {
    this.mode = mode;
    this.root.querySelectorAll("[data-mode]").forEach((b) => b.setAttribute("aria-pressed", b.dataset.mode === mode));
    this.root.querySelectorAll("[data-scale]").forEach((s) => { s.hidden = s.dataset.scale !== mode; });
    if (mode === "distance") this.measure();
    for (const { mesh, distances } of this.panels) {
      mesh.colors = colorsOf(mesh, mode, this.scales, distances);
      mesh.repaint = true;
    }
    this.say();
    this.turned();
  }

  // Compare the descriptors of all vertices with that of the pinned one.
  measure() {
    const from = this.pinned && this.panels[this.pinned.index].mesh;
    for (const panel of this.panels) {
      panel.distances = from && descriptorDistances(panel.mesh, from, this.pinned.vertex, this.steps);
    }
    const scale = this.scales.distance;
    scale.high = from ? quantile(this.panels.map((panel) => panel.distances), 0.5) : null; // to see what is alike
    this.root.querySelector(".high").textContent = from ? scale.high.toPrecision(3) : "?";
  }

  redraw() {
    if (this.pending) return;
    this.pending = requestAnimationFrame(() => {
      this.pending = 0;
      for (const panel of this.panels) if (panel.stale) this.paint(panel);
      drawMarks(this);
    });
  }

  paint(panel) {
    const { canvas, mesh, view } = panel, density = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(view.clientWidth * density)), height = Math.max(1, Math.round(view.clientHeight * density));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    panel.frame = { ...this.camera.frame(mesh, width, height), density, pattern: PATTERNS[this.mode] || 0 };
    this.painter.paint(mesh, panel.frame, canvas);
    panel.seen = null;
    panel.stale = false;
  }

  // The picture of vertex numbers of a panel, made when it is first needed after the camera has moved.
  numbers(panel) {
    if (panel.stale) this.paint(panel);
    panel.seen = panel.seen || this.painter.read(panel.mesh, panel.frame);
    return panel.seen;
  }

  // A place of the pointer as a fraction of the picture.
  at({ view }, event) {
    const box = view.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  }

  // What is seen at such a place, with its partners, or null.
  find(index, at) {
    const panel = this.panels[index], numbers = this.numbers(panel), { width, height } = panel.frame;
    const hit = pick(panel.mesh, panel.frame, numbers, at[0] * width, at[1] * height);
    return hit && partnersOf(this, index, hit.vertex, at);
  }

  hover(index, event) {
    if (event.pointerType === "touch") return;
    this.hovered = this.find(index, this.at(this.panels[index], event));
    this.say();
    this.redraw();
  }

  unhover() { this.hovered = null; this.say(); this.redraw(); }

  pin(index, at) { this.hold(this.find(index, at)); }

  unpin() { if (this.pinned) this.hold(null); }

  hold(found) {
    this.pinned = found;
    if (this.mode === "distance") this.show(this.mode);
    this.say();
    this.redraw();
  }

  say() {
    const pinned = this.root.querySelector(".pinned"), hovered = this.root.querySelector(".hovered");
    const ask = this.mode === "distance" && !this.pinned ? "Click a vertex to compare all others with it." : "";
    const held = this.pinned ? `Pinned: ${describe(this, this.pinned)}` : ask;
    if (pinned.textContent !== held) pinned.textContent = held; // it is read aloud when it changes
    hovered.textContent = this.hovered ? describe(this, this.hovered) : "";
  }
}

const FEW_FACES = 150000; // beyond this faces are about as small as pixels, and smooth edges cost more than they show

// Make a viewer of each block when it comes near the window: a report may have many.
function startViewers() {
  const roots = [...document.querySelectorAll(".viewer")], started = [];
  if (roots.length === 0) return;
  let painter;
  try {
    painter = new Painter(Math.max(...roots.map((root) => Number(root.dataset.faces))) <= FEW_FACES);
  } catch (error) {
    for (const root of roots) {
      root.classList.add("dead");
      root.querySelector(".pinned").textContent = `This browser cannot show the meshes: ${error.message}.`;
    }
    return;
  }
  painter.restored = () => started.forEach((viewer) => viewer.turned());
  const observer = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      observer.unobserve(target);
      target.viewer = new Viewer(target, painter);
      started.push(target.viewer);
    }
  }, { rootMargin: "300px" });
  roots.forEach((root) => observer.observe(root));
}

startViewers();
