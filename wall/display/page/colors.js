// A colour scale whose lightness grows evenly from dark violet by blue and green to pale yellow, told apart also by
// those who see no red or green. Made in OKLCH (Ottosson, "A perceptual color space for image processing", 2020).

const STOPS = [           // lightness, chroma, hue in degrees
  [0.26, 0.10, 300], [0.38, 0.12, 280], [0.50, 0.11, 245], [0.62, 0.10, 195], [0.74, 0.13, 150], [0.86, 0.16, 112],
  [0.95, 0.12, 104],
];

// (256) [red, green, blue], 0 to 255; lightness is linear in the index
export const SCALE = Array.from({ length: 256 }, (_, k) => {
  const at = (k / 255) * (STOPS.length - 1), n = Math.min(Math.floor(at), STOPS.length - 2), f = at - n;
  const [l, c, h] = STOPS[n].map((x, i) => x + (STOPS[n + 1][i] - x) * f);
  return rgb(STOPS[0][0] + (k / 255) * (STOPS.at(-1)[0] - STOPS[0][0]), c, (h * Math.PI) / 180);
});

export const GRADIENT = `linear-gradient(to right, ${
  [...Array(17).keys()].map((k) => `rgb(${SCALE[Math.round(k * 255 / 16)].join(" ")})`).join(", ")})`;

function rgb(lightness, chroma, hue) {
  const a = chroma * Math.cos(hue), b = chroma * Math.sin(hue);
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3;
  return [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s,
  ].map((x) => Math.round(255 * encoded(Math.min(Math.max(x, 0), 1))));
}

function encoded(x) { return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055; }   // IEC 61966-2-1
