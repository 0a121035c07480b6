// The colours of a mesh in each mode, four bytes per vertex; the last is 0 where nothing is known.

const PLAIN = [196, 203, 214], PATTERNS = { checker: 1, stripes: 2 };

function colorsOf(mesh, mode, scales, distances) {
  const scale = scales[mode];
  if (mode === "matched" || mode in PATTERNS) return shown(mesh.base, (i) => !mesh.map || mesh.map[i] >= 0);
  const values = mode === "distance" ? distances : mesh.values[mode];
  return scale && values ? ramped(values, scale.ramp, scale.high) : uniform(mesh.n);
}

function uniform(n) {
  const out = new Uint8Array(4 * n);
  for (let i = 0; i < out.length; i++) out[i] = i % 4 === 3 ? 255 : PLAIN[i % 4];
  return out;
}

function shown(rgb, known) {
  const n = rgb.length / 3, out = new Uint8Array(4 * n);
  for (let i = 0; i < n; i++) {
    for (let d = 0; d < 3; d++) out[4 * i + d] = rgb[3 * i + d];
    out[4 * i + 3] = known(i) ? 255 : 0;
  }
  return out;
}

function ramped(values, ramp, high) {
  const last = ramp.length / 3 - 1, out = new Uint8Array(4 * values.length);
  for (let i = 0; i < values.length; i++) {
    if (!Number.isFinite(values[i])) continue;
    const shade = Math.round(last * Math.max(0, Math.min(1, values[i] / (high || 1))));
    for (let d = 0; d < 3; d++) out[4 * i + d] = ramp[3 * shade + d];
    out[4 * i + 3] = 255;
  }
  return out;
}

const UNKNOWN = -128;

// Distances of the descriptors of a mesh to that of one vertex of another mesh, which may be the same.
function descriptorDistances(mesh, other, vertex, steps) {
  const p = steps.length, from = other.features.subarray(p * vertex, p * vertex + p);
  const out = new Float32Array(mesh.n).fill(NaN);
  if (from[0] === UNKNOWN) return out;
  for (let i = 0; i < mesh.n; i++) {
    if (mesh.features[p * i] === UNKNOWN) continue;
    let sum = 0;
    for (let k = 0; k < p; k++) sum += (steps[k] * (mesh.features[p * i + k] - from[k])) ** 2;
    out[i] = Math.sqrt(sum);
  }
  return out;
}

// The value that a fraction of the known values does not exceed.
function quantile(arrays, fraction) {
  const all = new Float32Array(arrays.reduce((sum, a) => sum + a.length, 0));
  let n = 0;
  for (const values of arrays) for (const value of values) if (Number.isFinite(value)) all[n++] = value;
  const known = all.subarray(0, n).sort();
  return n ? known[Math.min(n - 1, Math.floor(fraction * n))] : 0;
}
