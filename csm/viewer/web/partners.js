// Which vertices belong together.  Maps go to the reference mesh; back from it there may be none or several vertices.

// For a vertex of one mesh: its image on the reference and, for every mesh, the vertices that go there and the one of
// them to show, which is the nearest to `at`, a place in the picture as a fraction of its size.
function partnersOf(viewer, index, vertex, at) {
  const meshes = viewer.panels.map((panel) => panel.mesh), home = meshes[index];
  const image = index === viewer.reference ? vertex : home.map ? home.map[vertex] : -1;
  const others = meshes.map((mesh, i) => {
    if (i === index) return { chosen: vertex, all: [vertex] };
    if (image < 0) return { chosen: -1, all: [] };
    if (i === viewer.reference) return { chosen: image, all: [image] };
    if (!mesh.map) return { chosen: -1, all: [] };
    const all = preimages(mesh, meshes[viewer.reference], image);
    return { chosen: nearestTo(at, all, viewer.panels[i]), all };
  });
  return { index, vertex, at, image, others };
}

function preimages(mesh, reference, image) {
  mesh.back = mesh.back || grouped(mesh.map, reference.n);
  return mesh.back.items.subarray(mesh.back.start[image], mesh.back.start[image + 1]);
}

function nearestTo([x, y], vertices, { mesh, frame }) {
  let chosen = -1, least = Infinity;
  for (const vertex of vertices) {
    const [px, py] = project(mesh, frame, vertex), away = Math.hypot(px - x * frame.width, py - y * frame.height);
    if (away < least) [chosen, least] = [vertex, away];
  }
  return chosen;
}

// The vertex of the reference nearest to one that nothing is mapped to that something is mapped to, or -1.
function nearestReached(reference, vertex, mesh) {
  const { start } = mesh.back, v = reference.vertices;
  let chosen = -1, least = Infinity;
  for (let i = 0; i < reference.n; i++) {
    if (start[i] === start[i + 1]) continue;
    let away = 0;
    for (let d = 0; d < 3; d++) away += (v[3 * i + d] - v[3 * vertex + d]) ** 2;
    if (away < least) [chosen, least] = [i, away];
  }
  return chosen;
}
