// A pixel: its values, and its fragment list as a stack of layers.

async function inspect(scene, images, left, right, pixel) {
  const place = pixel.y * scene.width + pixel.x;
  const names = [...new Set([REFERENCE, left, right])];
  const shown = names.map((name) => (name === REFERENCE ? scene : images.get(name)));
  const values = await Promise.all(shown.map((image) => valuesOf(image, place, pixel)));
  const list = scene.lists && (await listOf(scene.lists, place));
  return () => {
    showValues(scene, names, values, right);
    showLayers(scene, list);
  };
}

/** RGBA: of the float32 image, or where the page has none of the image that is shown, without alpha. */
async function valuesOf(image, place, { y, x }) {
  if (image.values) return (await array(Float32Array, image.values)).slice(4 * place, 4 * place + 4);
  const one = new OffscreenCanvas(1, 1).getContext("2d");
  one.drawImage(image.element, -x, -y);
  return [...[...one.getImageData(0, 0, 1, 1).data].slice(0, 3).map((step) => unshown(step / 255)), NaN];
}

/** The number behind what is shown: sRGB decoded, IEC 61966-2-1, where it was encoded. */
function unshown(encoded) {
  if (!about.srgb) return encoded;
  return encoded <= 0.04045 ? encoded / 12.92 : ((encoded + 0.055) / 1.055) ** 2.4;
}

function showValues(scene, names, values, right) {
  const count = scene.values ? 6 : 3;
  const rows = names.map((name, i) => valueRow(name, values[i], count));
  if (right !== REFERENCE) {
    const of = values[names.indexOf(right)];
    rows.push(valueRow(`${right} − ${REFERENCE}`, of.map((value, c) => value - values[0][c]), 3));
  }
  document.querySelector("#values tbody").replaceChildren(...rows);
  note("values-note", scene.values ? "" : `From the images of 8 bits, as float32 has no room: ${scene.why.values}.`);
}

function valueRow(name, values, count) {
  const row = document.createElement("tr");
  const head = document.createElement("th");
  head.scope = "row";
  head.textContent = name;
  row.append(head, ...Array.from(values, (value) => cell(digits(value, count))));
  return row;
}

function note(id, text) {
  const element = document.getElementById(id);
  element.textContent = text;
  element.hidden = !text;
}

function showLayers(scene, list) {
  document.getElementById("layers-box").hidden = !list?.layers.length;
  if (!list) return note("layers-note", `The page has no lists of this scene: ${scene.why.lists}.`);
  const { layers, background } = list;
  if (!layers.length) return note("layers-note", "The list is empty: no translucent fragment covers this pixel.");
  // Of other modes what shows of a layer is no single number.
  const over = layers.every((layer) => layer.mode === "over");
  const count = `${layers.length} ${layers.length === 1 ? "fragment" : "fragments"}, front to back.`;
  note("layers-note", over ? count : `${count} Blend modes other than over: T and T·α are left out.`);
  let through = 1;
  const sum = [0, 0, 0, 0];
  const rows = layers.map((layer, i) => {
    const weight = through * layer.color[3];
    for (const c of [0, 1, 2]) sum[c] += weight * layer.color[c];
    sum[3] += weight;
    const row = layerRow(String(i + 1), layer.color, over && { through, weight, sum });
    row.children[1].textContent = digits(layer.depth, 6);
    row.children[4].textContent = over ? layer.primitive : `${layer.primitive} ${layer.mode}`;
    through *= 1 - layer.color[3];
    return row;
  });
  const weight = through * background[3];
  const all = [...sum.slice(0, 3).map((value, c) => value + weight * background[c]), sum[3] + weight];
  const last = layerRow("behind", background, over && { through, weight, sum: all });
  last.className = "behind";
  document.querySelector("#layers tbody").replaceChildren(...rows, last);
}

/** Layer, depth, α, RGB, primitive, T, T·α, swatch so far, RGB so far. */
function layerRow(name, color, over) {
  const row = document.createElement("tr");
  const layer = document.createElement("th");
  layer.scope = "row";
  layer.append(Object.assign(document.createElement("span"), { textContent: name }), swatch(color));
  row.append(layer, cell(""), cell(digits(color[3])), cell(decimals(color.slice(0, 3))), cell(""));
  if (!over) {
    row.append(cell("–"), cell("–"), cell(""), cell("–"));
    return row;
  }
  const weight = cell(digits(over.weight), "weight");
  weight.style.setProperty("--weight", over.weight);
  const [r, g, b, a] = over.sum;
  const straight = a > 0 ? [r / a, g / a, b / a, a] : [0, 0, 0, 0];
  const sofar = document.createElement("td");
  sofar.append(swatch(straight));
  row.append(cell(digits(over.through)), weight, sofar, cell(decimals([r, g, b])));
  return row;
}

/** A straight colour over a checkerboard, shown as the images are. */
function swatch([r, g, b, a]) {
  const made = document.createElement("span");
  made.className = "swatch";
  made.style.setProperty("--color", `color(${about.srgb ? "srgb-linear" : "srgb"} ${r} ${g} ${b} / ${a})`);
  return made;
}
