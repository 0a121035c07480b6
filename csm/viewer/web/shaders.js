// What the graphics card runs: light and patterns on the surface, and a picture of vertex numbers for picking.

const ATTRIBUTES = ["position", "normal", "color", "place"];

const SURFACE_VERTEX = `#version 300 es
in vec3 position, normal, place;
in vec4 color;
uniform mat3 turn;
uniform vec3 centre, scale;
uniform vec2 shift;
out vec3 vNormal, vPlace;
out vec4 vColor;
void main() {
  vec3 p = turn * (position - centre);
  gl_Position = vec4(p.xy * scale.xy + shift, -p.z * scale.z, 1.0);
  vNormal = turn * normal;
  vColor = color;
  vPlace = place;
}`;

// Patterns are functions of the place on the mesh that is mapped to, so they are sharp however coarse the mesh is.
const SURFACE_FRAGMENT = `#version 300 es
precision highp float;
in vec3 vNormal, vPlace;
in vec4 vColor;
uniform int pattern;
uniform float density;
out vec4 pixel;
const float PI = 3.14159265;
const vec3 KEY = normalize(vec3(-0.45, 0.60, 0.66)), FILL = normalize(vec3(0.85, 0.05, 0.52));

// A wave of -1 and 1 with edges one pixel wide; where its periods are smaller than pixels it fades to 0.
vec3 square(vec3 x) {
  vec3 width = max(fwidth(x), 1e-6);
  return clamp(sin(PI * x) / (PI * width), -1.0, 1.0) * (1.0 - smoothstep(0.5, 1.2, width));
}

vec3 surface() {
  if (vColor.a < 0.5) { // unknown
    float hatch = mod((gl_FragCoord.x + gl_FragCoord.y) / density, 7.0) < 2.0 ? 0.0 : 1.0;
    return mix(vec3(0.40), vec3(0.66), hatch);
  }
  if (pattern == 0) return vColor.rgb;
  vec3 cells = square(vPlace * 20.0 + vec3(0.0, 0.5, 0.5));
  float slanted = square(vec3(dot(vPlace, vec3(0.6, 0.8, 0.0)) * 34.0)).x;
  float tone = pattern == 1 ? cells.x * cells.y * cells.z : slanted;
  return mix(vColor.rgb * 0.52, mix(vColor.rgb, vec3(1.0), 0.3), 0.5 + 0.5 * tone);
}

void main() {
  vec3 n = normalize(vNormal + vec3(0.0, 0.0, 1e-9));
  if (n.z < 0.0) n = -n; // an open shape has an inside to be seen
  float key = 0.74 * clamp(0.85 * dot(n, KEY) + 0.15, 0.0, 1.0);
  float light = key + 0.20 * max(dot(n, FILL), 0.0) + 0.17 + 0.06 * n.y;
  float gloss = 0.06 * pow(max(dot(n, normalize(KEY + vec3(0.0, 0.0, 1.0))), 0.0), 32.0);
  vec3 linear = pow(surface(), vec3(2.2)) * light + gloss;
  pixel = vec4(pow(clamp(linear, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);
}`;

// Every pixel gets the number, plus one, of some corner of the face that is seen there, in four bytes.
const NUMBER_VERTEX = `#version 300 es
in vec3 position;
uniform mat3 turn;
uniform vec3 centre, scale;
uniform vec2 shift;
flat out uint number;
void main() {
  vec3 p = turn * (position - centre);
  gl_Position = vec4(p.xy * scale.xy + shift, -p.z * scale.z, 1.0);
  number = uint(gl_VertexID) + 1u;
}`;

const NUMBER_FRAGMENT = `#version 300 es
precision highp float;
flat in highp uint number;
out vec4 pixel;
void main() {
  pixel = vec4(number & 255u, (number >> 8) & 255u, (number >> 16) & 255u, number >> 24) / 255.0;
}`;
