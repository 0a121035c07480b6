// What is said of a vertex, in words.

function describe(viewer, { index, vertex, image, others }) {
  const home = viewer.panels[index].mesh, reference = viewer.panels[viewer.reference].mesh;
  const name = `${home.label}: vertex ${vertex}`, parts = [];
  if (index === viewer.reference) {
    viewer.panels.forEach(({ mesh }, i) => { if (mesh.map) parts.push(comesFrom(mesh, reference, vertex, others[i])); });
  } else if (home.map) {
    parts.push(image < 0 ? "has no counterpart" : `→ ${reference.label}: vertex ${image}`);
  }
  for (const [key, word] of [["confidence", "confidence"], ["errors", "error"], ["distance", "descriptor distance"]]) {
    const values = key === "distance" ? viewer.mode === key && viewer.panels[index].distances : home.values[key];
    if (values && Number.isFinite(values[vertex])) parts.push(`· ${word} ${values[vertex].toPrecision(3)}`);
  }
  return [name, ...parts].join(" ");
}

function comesFrom(mesh, reference, vertex, { chosen, all }) {
  if (all.length === 1) return `← ${mesh.label}: vertex ${chosen}`;
  if (all.length > 1) return `← ${mesh.label}: vertex ${chosen} and ${all.length - 1} more`;
  const near = nearestReached(reference, vertex, mesh);
  const hint = near < 0 ? "" : ` (the nearest that is reached is ${near})`;
  return `← no vertex of ${mesh.label}${hint}`;
}
