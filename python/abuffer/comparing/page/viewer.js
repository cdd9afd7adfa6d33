// The two images, or how far off they are, with a slider between them.

const canvas = document.getElementById("canvas");
const context = canvas.getContext("2d");
const divider = document.getElementById("divider");
const LARGEST_ZOOM = 64;
const REFERENCE = "reference";
const NOT_FINITE = -32768;
const LARGEST_STEP = 32767;
// Colours of differences, from none to as much as the scale has: darker is less.
const ABOVE = [[16, 16, 18], [196, 84, 12], [255, 208, 120]];
const BELOW = [[16, 16, 18], [24, 98, 196], [120, 200, 255]];
const NO_NUMBER = [255, 0, 255];

// `zoom` in screen pixels a pixel; (x, y) is what is shown at the top left, in pixels of the image.
const view = { zoom: 1, x: 0, y: 0, fitted: true, split: 0.5, mode: "images", gain: 1, pixel: null };
// What is drawn: of either side its name and its picture, which is the image or a canvas of differences.
const drawn = { width: 1, height: 1, mode: "images", left: null, right: null };

function fitZoom() {
  return Math.min(canvas.clientWidth / drawn.width, canvas.clientHeight / drawn.height);
}

function leastZoom() {
  return Math.min(fitZoom(), 1);
}

function fit() {
  view.fitted = true;
  view.zoom = fitZoom();
  view.x = (drawn.width - canvas.clientWidth / view.zoom) / 2;
  view.y = (drawn.height - canvas.clientHeight / view.zoom) / 2;
  draw();
}

/** Zooms, and leaves what is at (left, top) of the canvas there. */
function zoomBy(factor, left = canvas.clientWidth / 2, top = canvas.clientHeight / 2) {
  const zoom = Math.min(Math.max(view.zoom * factor, leastZoom()), LARGEST_ZOOM);
  view.fitted = false;
  view.x += left / view.zoom - left / zoom;
  view.y += top / view.zoom - top / zoom;
  view.zoom = zoom;
  keepInSight();
  draw();
}

function pan(dx, dy) {
  view.fitted = false;
  view.x -= dx / view.zoom;
  view.y -= dy / view.zoom;
  keepInSight();
  draw();
}

/** The middle of the canvas stays within the image. */
function keepInSight() {
  const [halfX, halfY] = [canvas.clientWidth / view.zoom / 2, canvas.clientHeight / view.zoom / 2];
  view.x = Math.min(Math.max(view.x, -halfX), drawn.width - halfX);
  view.y = Math.min(Math.max(view.y, -halfY), drawn.height - halfY);
}

function show(pixel) {
  const [columns, rows] = [canvas.clientWidth / view.zoom, canvas.clientHeight / view.zoom];
  view.x = Math.min(Math.max(view.x, pixel.x + 2 - columns), pixel.x - 1);
  view.y = Math.min(Math.max(view.y, pixel.y + 2 - rows), pixel.y - 1);
}

/** The pixel at (left, top) of the canvas, or null beside the image. */
function pixelAt(left, top) {
  const [x, y] = [Math.floor(view.x + left / view.zoom), Math.floor(view.y + top / view.zoom)];
  return x >= 0 && y >= 0 && x < drawn.width && y < drawn.height ? { y, x } : null;
}

function moveDivider(split) {
  view.split = Math.min(Math.max(split, 0), 1);
  draw();
}

function draw() {
  if (!drawn.right) return;
  const ratio = devicePixelRatio;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((size) => Math.round(size * ratio));
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const scale = view.zoom * ratio;
  context.resetTransform();
  context.clearRect(0, 0, width, height);
  context.setTransform(scale, 0, 0, scale, -view.x * scale, -view.y * scale);
  context.imageSmoothingEnabled = view.zoom < 1;
  // The reference is off by nothing: beside it a difference has all of the canvas.
  const alone = drawn.mode === "difference" && drawn.left.name === REFERENCE;
  const split = alone ? 0 : Math.round(view.split * width);
  half(drawn.left, 0, split, height, scale);
  half(drawn.right, split, width, height, scale);
  if (view.pixel) outline(view.pixel, scale, ratio);
  divider.hidden = alone;
  document.getElementById("left-name").hidden = alone;
  divider.style.left = `${100 * view.split}%`;
  divider.setAttribute("aria-valuenow", Math.round(100 * view.split));
  document.getElementById("zoom").textContent = `${digits(view.zoom, 2)}×`;
}

function half(side, from, to, height, scale) {
  context.save();
  context.beginPath();
  context.rect(view.x + from / scale, view.y, (to - from) / scale, height / scale);
  context.clip();
  context.drawImage(side.picture, 0, 0);
  context.restore();
}

/** The pixel of an image that is most off; without an image that in the middle. */
async function worstPixel(image) {
  if (!image) return { y: drawn.height >> 1, x: drawn.width >> 1 };
  const steps = await array(Int16Array, image.difference.steps);
  const sizes = steps.map((count) => (count === NOT_FINITE ? LARGEST_STEP : Math.abs(count)));
  const place = sizes.indexOf(sizes.reduce((most, size) => Math.max(most, size), 0));
  return { y: Math.floor(place / drawn.width), x: place % drawn.width };
}

/** Black around white, so that it shows on all. */
function outline({ y, x }, scale, ratio) {
  context.resetTransform();
  const [left, top, size] = [(x - view.x) * scale, (y - view.y) * scale, Math.max(scale, 4 * ratio)];
  const grown = (size - scale) / 2;
  for (const [width, style] of [[4, "black"], [2, "white"]]) {
    context.lineWidth = width * ratio;
    context.strokeStyle = style;
    context.strokeRect(left - grown, top - grown, size, size);
  }
}

/** A canvas of differences, in steps of `step`; the reference has none. */
function differenceImage(steps, step) {
  const image = new ImageData(drawn.width, drawn.height);
  const pixels = new Uint32Array(image.data.buffer);
  const [above, below] = [shades(ABOVE), shades(BELOW)];
  pixels.fill(above[0]);
  steps?.forEach((count, i) => {
    const off = count * step * view.gain;
    const shade = Math.min(Math.round(Math.abs(off) * 255), 255);
    pixels[i] = count === NOT_FINITE ? packed(NO_NUMBER) : (off < 0 ? below : above)[shade];
  });
  const made = new OffscreenCanvas(drawn.width, drawn.height);
  made.getContext("2d").putImageData(image, 0, 0);
  return made;
}

/** 256 colours through these. */
function shades(colors) {
  return Array.from({ length: 256 }, (_, i) => {
    const at = (i / 255) * (colors.length - 1);
    const low = Math.min(Math.floor(at), colors.length - 2);
    return packed(colors[low].map((channel, c) => Math.round(channel + (at - low) * (colors[low + 1][c] - channel))));
  });
}

/** Opaque, as four bytes of an ImageData. */
function packed([r, g, b]) {
  return (0xff000000 | (b << 16) | (g << 8) | r) >>> 0;
}

function drawScale() {
  const stops = [...BELOW.toReversed(), ...ABOVE.slice(1)].map((color) => `rgb(${color})`);
  document.getElementById("colors").style.background = `linear-gradient(90deg, ${stops})`;
  document.getElementById("least").textContent = `−${digits(1 / view.gain)}`;
  document.getElementById("most").textContent = `+${digits(1 / view.gain)}`;
  document.getElementById("gain-value").textContent = `×${digits(view.gain)}`;
}
