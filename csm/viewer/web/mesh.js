// A mesh as it came in the page: arrays decoded, centred, with its size across and along the upright axis.

function decode(text, Type) {
  const bytes = atob(text), out = new Uint8Array(bytes.length);
  for (let i = 0; i < out.length; i++) out[i] = bytes.charCodeAt(i);
  return new Type(out.buffer);
}

function readMesh(data) {
  const vertices = decode(data.vertices, Float32Array);
  const faces = decode(data.faces, data.wide ? Uint32Array : Uint16Array);
  const mesh = {
    label: data.label, axes: data.axes, wide: data.wide, vertices, faces, n: vertices.length / 3,
    normals: vertexNormals(vertices, faces), base: decode(data.colors, Uint8Array),
    map: data.map && decode(data.map, Int32Array), features: data.features && decode(data.features, Int8Array),
    values: {
      errors: data.errors && decode(data.errors, Float32Array),
      confidence: data.confidence && decode(data.confidence, Float32Array),
    },
  };
  return Object.assign(mesh, extent(mesh));
}

// Centre and size; vertices without a face have no say in the framing.
function extent({ vertices, faces, axes }) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let f = 0; f < faces.length; f++) {
    for (let d = 0; d < 3; d++) {
      const x = vertices[3 * faces[f] + d];
      if (x < low[d]) low[d] = x;
      if (x > high[d]) high[d] = x;
    }
  }
  const centre = low.map((x, d) => (x + high[d]) / 2), [r, u, t] = axes;
  let across = 0, along = 0;
  for (let f = 0; f < faces.length; f++) {
    const i = 3 * faces[f];
    const x = vertices[i] - centre[0], y = vertices[i + 1] - centre[1], z = vertices[i + 2] - centre[2];
    across = Math.max(across, Math.hypot(r[0] * x + r[1] * y + r[2] * z, t[0] * x + t[1] * y + t[2] * z));
    along = Math.max(along, Math.abs(u[0] * x + u[1] * y + u[2] * z));
  }
  return { centre, across: across || 1, along: along || 1, radius: Math.hypot(across, along) || 1 };
}

function vertexNormals(v, faces) {
  const normals = new Float32Array(v.length);
  for (let f = 0; f < faces.length; f += 3) {
    const i = 3 * faces[f], j = 3 * faces[f + 1], k = 3 * faces[f + 2];
    const ux = v[j] - v[i], uy = v[j + 1] - v[i + 1], uz = v[j + 2] - v[i + 2];
    const wx = v[k] - v[i], wy = v[k + 1] - v[i + 1], wz = v[k + 2] - v[i + 2];
    const x = uy * wz - uz * wy, y = uz * wx - ux * wz, z = ux * wy - uy * wx;
    for (let c = 0; c < 3; c++) {
      const at = c === 0 ? i : c === 1 ? j : k;
      normals[at] += x; normals[at + 1] += y; normals[at + 2] += z;
    }
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
    for (let d = 0; d < 3; d++) normals[i + d] /= length;
  }
  return normals;
}

// Lists of what points to each of n places: those of place i are items[start[i]] to items[start[i + 1] - 1].
function grouped(places, n) {
  const start = new Uint32Array(n + 1), items = new Uint32Array(places.length);
  for (let k = 0; k < places.length; k++) if (places[k] >= 0) start[places[k] + 1] += 1;
  for (let i = 0; i < n; i++) start[i + 1] += start[i];
  const next = start.slice();
  for (let k = 0; k < places.length; k++) if (places[k] >= 0) items[next[places[k]]++] = k;
  return { start, items };
}

// Where each vertex lies on the mesh that it is mapped to: right, up and front from its centre, in units of its size.
function placesOn(reference, map, n) {
  const { vertices, centre, axes } = reference, size = 2 * Math.max(reference.across, reference.along);
  const places = new Float32Array(3 * n);
  for (let i = 0; i < n; i++) {
    const j = map ? map[i] : i;
    if (j < 0) continue;
    const x = vertices[3 * j] - centre[0], y = vertices[3 * j + 1] - centre[1], z = vertices[3 * j + 2] - centre[2];
    for (let d = 0; d < 3; d++) places[3 * i + d] = (axes[d][0] * x + axes[d][1] * y + axes[d][2] * z) / size;
  }
  return places;
}
