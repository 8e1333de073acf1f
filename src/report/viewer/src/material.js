// How a mesh looks: a light at the eye, flat faces, colour by value, element edges drawn by the shader.

import { DataTexture, LinearFilter, NearestFilter, RGBAFormat, ShaderMaterial, DoubleSide } from "three";

const VERTEX = `
attribute float value;
attribute vec3 weight;
varying float v;
varying vec3 w;
varying vec3 p;
void main() {
  v = value;
  w = weight;
  vec4 eye = modelViewMatrix * vec4(position, 1.0);
  p = eye.xyz;
  gl_Position = projectionMatrix * eye;
}`;

const FRAGMENT = `
uniform sampler2D ramp;
uniform vec2 range;
uniform float edges;
varying float v;
varying vec3 w;
varying vec3 p;
void main() {
  vec3 normal = normalize(cross(dFdx(p), dFdy(p)));
  float t = (v - range.x) / max(range.y - range.x, 1e-30);
  vec3 colour = v < -1e38 ? vec3(0.72) : texture2D(ramp, vec2(t, 0.5)).rgb;
  float light = 0.5 + 0.42 * abs(normal.z) + 0.08 * (normal.y - 0.5 * normal.x);
  if (!gl_FrontFacing) colour = mix(colour, vec3(0.42, 0.40, 0.47), 0.55);
  colour = (colour * 0.92 + 0.06) * light;
  vec3 width = fwidth(w);
  vec3 near = smoothstep(vec3(0.0), width * 1.15, w);
  // Where elements are smaller than a few pixels, their edges would be all there is to see.
  float dense = max(width.x, max(width.y, width.z));
  float ink = (1.0 - min(near.x, min(near.y, near.z))) * edges * (1.0 - smoothstep(0.22, 0.55, dense));
  gl_FragColor = vec4(mix(colour, vec3(0.07, 0.09, 0.12), 0.62 * ink), 1.0);
}`;

/** A material with uniforms `ramp`, `range` and `edges`. */
export function material() {
  return new ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: { ramp: { value: null }, range: { value: [0, 1] }, edges: { value: 1 } },
    side: DoubleSide,
    // Lines on the mesh shall win against its faces.
    polygonOffset: true,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 2,
  });
}

function texture(colours, filter) {
  const data = new Uint8Array(4 * colours.length);
  colours.forEach((colour, i) => data.set([...colour, 255], 4 * i));
  const result = new DataTexture(data, colours.length, 1, RGBAFormat);
  result.minFilter = result.magFilter = filter;
  result.needsUpdate = true;
  return result;
}

/** Colours of a ramp between its stops. */
export function rampTexture(stops) {
  const colours = [];
  for (let i = 0; i < 256; i++) {
    const place = (i / 255) * (stops.length - 1);
    const below = Math.min(Math.floor(place), stops.length - 2);
    const part = place - below;
    colours.push(stops[below].map((low, k) => Math.round(low + part * (stops[below + 1][k] - low))));
  }
  return texture(colours, LinearFilter);
}

/** Colours of names: neighbours in number differ in hue, and repeat only after many. */
export function nameColour(index) {
  const hue = (index * 137.508 + 210) % 360;
  const lightness = [0.62, 0.74, 0.52][Math.floor(index / 7) % 3];
  const saturation = 0.5;
  const channel = (n) => {
    const k = (n + hue / 30) % 12;
    const a = saturation * Math.min(lightness, 1 - lightness);
    return Math.round(255 * (lightness - a * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
  };
  return [channel(0), channel(8), channel(4)];
}

/** Colours of the first `count` names. */
export function namesTexture(count) {
  return texture(Array.from({ length: Math.min(Math.max(count, 1), 4096) }, (_, i) => nameColour(i)), NearestFilter);
}
