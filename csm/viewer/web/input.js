// Mouse, pen, fingers and keys.

const STILL = 5; // css pixels that a click or tap may move

function listenToPointers(viewer, panel, index) {
  const canvas = panel.canvas, fingers = new Map();
  let travelled = 0;

  canvas.addEventListener("pointerdown", (event) => {
    travelled = fingers.size ? Infinity : 0; // a second finger makes it no tap
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true, focusVisible: false });
  });

  canvas.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId), here = [event.clientX, event.clientY];
    if (!last) return viewer.hover(index, event);
    const [dx, dy] = [here[0] - last[0], here[1] - last[1]];
    travelled += Math.hypot(dx, dy);
    fingers.set(event.pointerId, here);
    if (fingers.size === 1 && travelled <= STILL) return;
    if (fingers.size > 1) pinch(event.pointerId, last, here);
    else if (event.shiftKey || event.buttons & 6) viewer.camera.move(dx / canvas.clientWidth, dy / canvas.clientHeight);
    else viewer.camera.rotate(-0.5 * dx, 0.5 * dy);
    viewer.turned();
  });

  // One of two fingers moved: the meshes stay between the fingers and grow with their distance.
  function pinch(id, last, here) {
    const [, other] = [...fingers].find(([key]) => key !== id);
    const away = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
    viewer.camera.move((here[0] - last[0]) / 2 / canvas.clientWidth, (here[1] - last[1]) / 2 / canvas.clientHeight);
    const middle = { clientX: (here[0] + other[0]) / 2, clientY: (here[1] + other[1]) / 2 };
    viewer.camera.magnify(away(here) / away(last), viewer.at(panel, middle));
  }

  canvas.addEventListener("pointerup", (event) => {
    if (fingers.delete(event.pointerId) && fingers.size === 0 && travelled <= STILL && event.button === 0) {
      viewer.pin(index, viewer.at(panel, event));
    }
  });
  canvas.addEventListener("pointercancel", (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("pointerleave", () => { if (fingers.size === 0) viewer.unhover(); });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", () => viewer.reset());
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return; // until it is clicked, the wheel scrolls the page
    event.preventDefault();
    viewer.camera.magnify(Math.exp(-0.0015 * event.deltaY), viewer.at(panel, event));
    viewer.turned();
  }, { passive: false });
}

function listenToKeys(viewer) {
  viewer.root.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const panel = viewer.panels.findIndex(({ canvas }) => canvas === event.target);
    const turn = (azimuth, elevation) => () => { viewer.camera.rotate(azimuth, elevation); viewer.turned(); };
    const zoom = (factor) => () => { viewer.camera.magnify(factor); viewer.turned(); };
    const keys = {
      ArrowLeft: turn(-10, 0), ArrowRight: turn(10, 0), ArrowUp: turn(0, 10), ArrowDown: turn(0, -10),
      "+": zoom(1.2), "=": zoom(1.2), "-": zoom(1 / 1.2), 0: () => viewer.reset(), Escape: () => viewer.unpin(),
    };
    viewer.modes.forEach((mode, i) => { keys[i + 1] = () => viewer.show(mode); });
    if (panel >= 0) keys.Enter = () => viewer.pin(panel, [0.5, 0.5]);
    if (!(event.key in keys)) return;
    event.preventDefault();
    keys[event.key]();
  });
  document.addEventListener("keydown", (event) => { if (event.key === "Escape") viewer.unpin(); });
}
