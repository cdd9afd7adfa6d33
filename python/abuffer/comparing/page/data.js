// What the page holds: JSON in scripts of their own, read when they are first looked at, and arrays packed in it.

const about = read("page");
const parsed = new Map();
const unpacked = new Map();

function read(id) {
  return JSON.parse(document.getElementById(id).textContent);
}

function json(id) {
  if (!parsed.has(id)) parsed.set(id, read(id));
  return parsed.get(id);
}

/** The array that a text holds: deflated, little-endian, in base64. */
async function array(Type, text) {
  if (!unpacked.has(text)) unpacked.set(text, inflated(text));
  return new Type(await unpacked.get(text));
}

function inflated(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

/** Where each pixel's list begins, and where the last one ends. */
async function offsets(lists) {
  const counts = await array(Uint32Array, lists.counts);
  const begins = new Uint32Array(counts.length + 1);
  counts.forEach((count, pixel) => (begins[pixel + 1] = begins[pixel] + count));
  return begins;
}

/** The list of a pixel, front to back, with what is behind it. */
async function listOf(lists, pixel) {
  const begins = await offsets(lists);
  const [depth, color, primitive, background, blend] = await Promise.all([
    array(Float32Array, lists.depth),
    array(Float32Array, lists.color),
    array(Int32Array, lists.primitive),
    array(Float32Array, lists.background),
    lists.blend && array(Uint8Array, lists.blend),
  ]);
  const layers = [];
  for (let i = begins[pixel]; i < begins[pixel + 1]; i++) {
    const mode = lists.blends[blend ? blend[i] : 0];
    layers.push({ depth: depth[i], color: color.slice(4 * i, 4 * i + 4), primitive: primitive[i], mode });
  }
  return { layers, background: background.slice(4 * pixel, 4 * pixel + 4) };
}
