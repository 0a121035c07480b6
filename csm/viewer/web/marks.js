// Rings around vertices, as elements above the picture: they move without the mesh being painted again.

const MOST_DOTS = 60;

function drawMarks(viewer) {
  viewer.panels.forEach((panel, i) => {
    const marks = [];
    for (const [kind, found] of [["hover", viewer.hovered], ["pin", viewer.pinned]]) {
      if (!found) continue;
      const { chosen, all } = found.others[i];
      for (const vertex of all.subarray ? all.subarray(0, MOST_DOTS) : all) {
        if (vertex !== chosen) marks.push([`dot ${kind}`, vertex]);
      }
      if (chosen >= 0) marks.push([kind, chosen]);
    }
    panel.view.querySelectorAll(".mark").forEach((mark) => mark.remove());
    if (marks.length === 0) return;
    const numbers = viewer.numbers(panel), { density } = panel.frame;
    for (const [kind, vertex] of marks) {
      const place = project(panel.mesh, panel.frame, vertex), mark = document.createElement("span");
      mark.className = `mark ${kind}${isHidden(panel.mesh, panel.frame, numbers, place) ? " hidden" : ""}`;
      mark.dataset.vertex = vertex;
      mark.style.left = `${place[0] / density}px`;
      mark.style.top = `${place[1] / density}px`;
      panel.view.append(mark);
    }
  });
}
