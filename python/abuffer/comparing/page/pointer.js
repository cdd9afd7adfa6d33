// Pointer, wheel and keys on the images and the slider.

const STEP = 0.01;
const LARGE_STEP = 0.1;
// Pixels of the screen that a click may move.
const CLICK = 4;

function listen(select) {
  let pressed = null;
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    pressed = { x: event.offsetX, y: event.offsetY, moved: false };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!pressed) return;
    const [dx, dy] = [event.offsetX - pressed.x, event.offsetY - pressed.y];
    if (!pressed.moved && Math.hypot(dx, dy) < CLICK) return;
    pan(dx, dy);
    pressed = { x: event.offsetX, y: event.offsetY, moved: true };
  });
  canvas.addEventListener("pointerup", (event) => {
    const pixel = pressed && !pressed.moved && pixelAt(event.offsetX, event.offsetY);
    pressed = null;
    if (pixel) select(pixel);
  });
  canvas.addEventListener("pointercancel", () => (pressed = null));
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (event.deltaY > 0 && view.zoom <= leastZoom()) return; // the page's own
      event.preventDefault();
      const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
      zoomBy(2 ** ((-event.deltaY * lines) / 200), event.offsetX, event.offsetY);
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => onCanvasKey(event, select));
  divider.addEventListener("pointerdown", (event) => divider.setPointerCapture(event.pointerId));
  divider.addEventListener("pointermove", (event) => {
    if (!divider.hasPointerCapture(event.pointerId)) return;
    const box = canvas.getBoundingClientRect();
    moveDivider((event.clientX - box.left) / box.width);
  });
  divider.addEventListener("keydown", onDividerKey);
  document.getElementById("zoom-in").addEventListener("click", () => zoomBy(2));
  document.getElementById("zoom-out").addEventListener("click", () => zoomBy(1 / 2));
  document.getElementById("fit").addEventListener("click", fit);
  new ResizeObserver(() => (view.fitted ? fit() : draw())).observe(canvas);
}

function onCanvasKey(event, select) {
  const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };
  const keys = { "+": () => zoomBy(2), "=": () => zoomBy(2), "-": () => zoomBy(1 / 2), 0: fit };
  if (event.ctrlKey || event.metaKey || event.altKey) return; // the browser's own
  if (event.key in steps) {
    const [dy, dx] = steps[event.key];
    const { y, x } = view.pixel ?? { y: drawn.height >> 1, x: drawn.width >> 1 };
    select({ y: y + dy, x: x + dx });
  } else if (event.key in keys) keys[event.key]();
  else return;
  event.preventDefault();
}

function onDividerKey(event) {
  const to = {
    ArrowLeft: view.split - STEP,
    ArrowDown: view.split - STEP,
    ArrowRight: view.split + STEP,
    ArrowUp: view.split + STEP,
    PageDown: view.split - LARGE_STEP,
    PageUp: view.split + LARGE_STEP,
    Home: 0,
    End: 1,
  }[event.key];
  if (to === undefined) return;
  event.preventDefault();
  moveDivider(to);
}
