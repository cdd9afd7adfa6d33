// Numbers as text.

/** Three significant digits; whole numbers with all of theirs. */
function digits(value, count = 3) {
  if (Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  if (Number.isInteger(value) && size < 1e9) return String(value);
  if (size < 1e-3 || size >= 1e6) return value.toExponential(count - 1);
  const text = value.toPrecision(count);
  return text.includes("e") ? String(Number(text)) : text;
}

/** Of colours, in columns below each other. */
function decimals(values) {
  return Array.from(values, (value) => (Number.isFinite(value) ? value.toFixed(3) : digits(value))).join(" ");
}
