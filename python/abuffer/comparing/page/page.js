// What is chosen, and what follows from it.

const main = document.querySelector("main");
const selects = Object.fromEntries(
  ["scene", "device", "left", "right"].map((id) => [id, document.getElementById(id)]),
);
const inputs = { y: document.getElementById("pixel-y"), x: document.getElementById("pixel-x") };
let current = { scene: null, rows: [], images: new Map() };
// Of what was asked for last: what comes late is not shown.
let turn = 0;

/** Fills a select, and keeps what was chosen where it still can be. */
function offer(select, names, otherwise) {
  const before = select.value;
  select.replaceChildren(...names.map((name) => new Option(name, name)));
  select.value = names.includes(before) ? before : (otherwise ?? names[0] ?? "");
}

function imageElement(png, name) {
  const image = new Image();
  image.src = `data:image/png;base64,${png}`;
  image.alt = name;
  return image;
}

/** Another scene or device; of images of another size the pixel that is most off. */
async function load() {
  const measured = about.cells.filter((each) => each.scene === selects.scene.value);
  offer(selects.device, measured.map((each) => each.device));
  const { id } = measured.find((each) => each.device === selects.device.value);
  const scene = json(`scene-${id.split("-")[0]}`);
  const cell = json(`cell-${id}`);
  const [{ rows }, images] = [cell, new Map(cell.images)];
  scene.element ??= imageElement(scene.png, REFERENCE);
  for (const [name, image] of images) image.element ??= imageElement(image.png, name);
  current = { scene, rows, images };
  fillTable(rows);
  // What the canvas shows, for those who do not see it.
  canvas.replaceChildren(scene.element, ...[...images.values()].map((image) => image.element));
  document.getElementById("plot").replaceChildren(document.getElementById(`plot-${id}`).content.cloneNode(true));
  const names = [...images.keys()];
  offer(selects.left, [REFERENCE, ...names]);
  const worst = ordered(rows, about.columns.indexOf("rmse"), true).find((row) => images.has(row.label));
  offer(selects.right, [REFERENCE, ...names], worst?.label);
  const another = !view.pixel || drawn.width !== scene.width || drawn.height !== scene.height;
  [drawn.width, drawn.height] = [scene.width, scene.height];
  [inputs.y.max, inputs.x.max] = [scene.height - 1, scene.width - 1];
  canvas.style.aspectRatio = `${scene.width} / ${scene.height}`;
  if (another) view.pixel = await worstPixel(images.get(selects.right.value));
  await update(another);
}

/** Other images, another gain, another pixel. */
async function update(refit = false) {
  const own = ++turn;
  main.setAttribute("aria-busy", "true");
  const { scene, images } = current;
  const [left, right] = [selects.left.value, selects.right.value];
  const sides = await Promise.all([left, right].map((name) => sideOf(name, scene, images)));
  const shown = await inspect(scene, images, left, right, view.pixel);
  if (own !== turn) return;
  [drawn.left, drawn.right] = sides;
  drawn.mode = view.mode;
  markRow(right);
  for (const side of ["left", "right"]) {
    const { name } = drawn[side];
    const minuend = drawn.mode === "images" || name === REFERENCE ? name : `${name} − ${REFERENCE}`;
    document.getElementById(`${side}-name`).textContent = minuend;
  }
  [inputs.y.value, inputs.x.value] = [view.pixel.y, view.pixel.x];
  shown();
  drawScale();
  if (refit) fit();
  else draw();
  main.setAttribute("aria-busy", "false");
}

async function sideOf(name, scene, images) {
  const image = name === REFERENCE ? scene : images.get(name);
  await image.element.decode();
  if (view.mode === "images") return { name, picture: image.element };
  const steps = image.difference && (await array(Int16Array, image.difference.steps));
  return { name, picture: differenceImage(steps, image.difference?.step) };
}

function selectPixel({ y, x }) {
  const within = (value, size) => Math.min(Math.max(Math.trunc(value) || 0, 0), size - 1);
  view.pixel = { y: within(y, drawn.height), x: within(x, drawn.width) };
  if (!view.fitted) show(view.pixel);
  update();
}

document.getElementById("worst").addEventListener("click", async () => {
  selectPixel(await worstPixel(current.images.get(selects.right.value)));
});
offer(selects.scene, [...new Set(about.cells.map((each) => each.scene))]);
selects.scene.addEventListener("change", load);
selects.device.addEventListener("change", load);
for (const side of [selects.left, selects.right]) side.addEventListener("change", () => update());
for (const input of Object.values(inputs)) {
  input.addEventListener("change", () => selectPixel({ y: inputs.y.value, x: inputs.x.value }));
}
for (const radio of document.querySelectorAll("[name=mode]")) {
  radio.addEventListener("change", () => {
    view.mode = radio.value;
    document.getElementById("scale").hidden = view.mode !== "difference";
    update();
  });
}
document.getElementById("gain").addEventListener("input", (event) => {
  view.gain = 10 ** Number(event.target.value);
  update();
});
document.getElementById("choice").addEventListener("submit", (event) => event.preventDefault());
document.getElementById("all-columns").addEventListener("change", (event) => {
  document.getElementById("rows").classList.toggle("all", event.target.checked);
});
document.querySelector("#rows thead").addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (!button) return;
  const column = Number(button.dataset.column);
  sorting.descending = column === sorting.column && !sorting.descending;
  sorting.column = column;
  fillTable(current.rows);
  markRow(selects.right.value);
});
body.addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (!button) return;
  selects.right.value = button.dataset.label;
  update();
});
listen(selectPixel);
load();
