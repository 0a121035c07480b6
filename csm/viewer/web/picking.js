// Which vertex is seen at a pixel.  The picture of numbers names one corner of the face there; of the few faces around
// that corner, the nearest one under the pixel is the face.  So the time does not depend on the size of the mesh.

function pick(mesh, frame, numbers, x, y) {
  const column = Math.floor(x), row = frame.height - 1 - Math.floor(y);
  if (column < 0 || row < 0 || column >= frame.width || row >= frame.height) return null;
  const number = numbers[row * frame.width + column];
  if (number === 0) return null;
  mesh.around = mesh.around || grouped(mesh.faces, mesh.n);
  const { start, items } = mesh.around, corner = number - 1, middle = [column + 0.5, Math.floor(y) + 0.5];
  let best = null;
  for (let k = start[corner]; k < start[corner + 1]; k++) {
    const hit = under(mesh, frame, items[k] - items[k] % 3, middle);
    if (hit && (best === null || hit.near > best.near)) best = hit;
  }
  return best || { vertex: corner, near: project(mesh, frame, corner)[2] };
}

// If a face lies under a pixel: how near it is there, and the corner that has the most of it.
function under(mesh, frame, first, [x, y]) {
  const corners = [0, 1, 2].map((c) => mesh.faces[first + c]), [a, b, c] = corners.map((v) => project(mesh, frame, v));
  const side = (p, q) => (p[0] - x) * (q[1] - y) - (p[1] - y) * (q[0] - x);
  const weights = [side(b, c), side(c, a), side(a, b)], sum = weights[0] + weights[1] + weights[2];
  if (sum === 0 || weights.some((w) => w * sum < 0)) return null;
  const near = (weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]) / sum;
  const shares = weights.map((w) => w / sum);
  return { near, vertex: corners[shares.indexOf(Math.max(...shares))] };
}

// Whether a vertex lies behind the surface that is seen at its place.
function isHidden(mesh, frame, numbers, [x, y, near]) {
  const hit = pick(mesh, frame, numbers, x, y);
  return hit !== null && hit.near > near + 0.02 * frame.scale * mesh.radius;
}
