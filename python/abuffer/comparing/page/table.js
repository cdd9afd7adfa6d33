// The table of rows.

const body = document.querySelector("#rows tbody");
const heads = [...document.querySelectorAll("#rows thead th")];
const more = heads.slice(1).map((head) => head.classList.contains("more"));
const sorting = { column: about.columns.indexOf("rmse"), descending: false };

function valueOf(row, column) {
  return column < 0 ? row.label : Number(row.values[column]);
}

/** Sorted by a column; what is no number comes last either way, and equal rows keep their order. */
function ordered(rows, column, descending) {
  const compared = (a, b) => (a < b ? -1 : a > b ? 1 : 0);
  return rows.toSorted((one, other) => {
    const [a, b] = [valueOf(one, column), valueOf(other, column)];
    const missing = Number.isNaN(a) - Number.isNaN(b);
    return missing || (descending ? compared(b, a) : compared(a, b));
  });
}

function fillTable(rows) {
  for (const head of heads) {
    const own = Number(head.firstElementChild.dataset.column) === sorting.column;
    if (own) head.setAttribute("aria-sort", sorting.descending ? "descending" : "ascending");
    else head.removeAttribute("aria-sort");
  }
  body.replaceChildren(...ordered(rows, sorting.column, sorting.descending).map(tableRow));
}

/** Marks the row whose image is shown. */
function markRow(label) {
  for (const button of body.querySelectorAll("button")) {
    button.closest("tr").toggleAttribute("aria-current", button.dataset.label === label);
  }
}

function tableRow(row) {
  const line = document.createElement("tr");
  const name = document.createElement("th");
  name.scope = "row";
  if (row.failure) {
    name.textContent = row.label;
    const why = cell(row.failure, "failure");
    why.colSpan = about.columns.length;
    line.append(name, why);
    return line;
  }
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = row.label;
  button.dataset.label = row.label;
  name.append(button);
  if (row.undominated) {
    const mark = document.createElement("span");
    mark.className = "mark";
    mark.textContent = "◆";
    mark.title = "not dominated";
    mark.setAttribute("role", "img");
    mark.setAttribute("aria-label", mark.title);
    name.append(mark);
  }
  const cells = row.values.map((value, i) => cell(written(about.columns[i], Number(value)), more[i] ? "more" : ""));
  line.append(name, ...cells);
  return line;
}

function written(column, value) {
  return column === "deterministic" && !Number.isNaN(value) ? (value ? "yes" : "no") : digits(value);
}

function cell(text, className = "") {
  const made = document.createElement("td");
  made.textContent = text;
  if (className) made.className = className;
  return made;
}
