// Where the viewer stands: one camera for all meshes of a viewer.

class Camera {
  constructor(start) {
    this.start = start;
    this.reset();
  }

  reset() { Object.assign(this, { azimuth: this.start.azimuth, elevation: this.start.elevation, zoom: 1, x: 0, y: 0 }); }

  rotate(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.max(-89, Math.min(89, this.elevation + elevation));
  }

  // Move by fractions of the picture's width and height.
  move(dx, dy) { this.x += dx; this.y += dy; }

  // Zoom around a place that stays where it is, given as fractions of the picture.
  magnify(factor, [x, y] = [0.5, 0.5]) {
    const zoom = Math.max(0.3, Math.min(40, this.zoom * factor)), change = zoom / this.zoom;
    this.x = x - 0.5 + (this.x - x + 0.5) * change;
    this.y = y - 0.5 + (this.y - y + 0.5) * change;
    this.zoom = zoom;
  }

  // Rows of the rotation, pixels per unit and shift in pixels, for a mesh in a picture of this size.
  frame(mesh, width, height) {
    const a = this.azimuth * Math.PI / 180, e = this.elevation * Math.PI / 180, [right, up, front] = mesh.axes;
    const mix = (...terms) => [0, 1, 2].map((d) => terms.reduce((sum, [w, v]) => sum + w * v[d], 0));
    const side = mix([Math.cos(a), right], [-Math.sin(a), front]);
    const level = mix([Math.cos(a), front], [Math.sin(a), right]);
    const turn = [side, mix([Math.cos(e), up], [-Math.sin(e), level]), mix([Math.cos(e), level], [Math.sin(e), up])];
    const scale = 0.47 * this.zoom * Math.min(width / mesh.across, height / mesh.along);
    return { turn, scale, width, height, x: this.x * width, y: this.y * height };
  }
}

// A vertex in pixels of the picture, from its upper left corner, and how near it is.
function project(mesh, frame, vertex) {
  const v = mesh.vertices, c = mesh.centre, i = 3 * vertex, [r, u, t] = frame.turn;
  const x = v[i] - c[0], y = v[i + 1] - c[1], z = v[i + 2] - c[2];
  return [
    frame.width / 2 + frame.x + frame.scale * (r[0] * x + r[1] * y + r[2] * z),
    frame.height / 2 + frame.y - frame.scale * (u[0] * x + u[1] * y + u[2] * z),
    frame.scale * (t[0] * x + t[1] * y + t[2] * z),
  ];
}
