
"use strict";
// Sorts a table by the buttons that it puts into the head, filters it by words. Without it the table is as it stands.
const words = new Intl.Collator("en", { numeric: true });
for (const box of document.querySelectorAll(".runs")) {
  const tools = box.querySelector(".tools");
  const input = box.querySelector("input");
  const count = box.querySelector("output");
  const body = box.querySelector("tbody");
  const rows = Array.from(body.rows);
  const texts = rows.map((row) => Array.from(row.cells, (cell) => cell.textContent).join(" ").toLowerCase());

  const filter = () => {
    const wanted = input.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    rows.forEach((row, i) => {
      row.hidden = !wanted.every((word) => texts[i].includes(word));
      shown += row.hidden ? 0 : 1;
    });
    count.textContent = `${shown} of ${rows.length} rows`;
  };

  const sort = (head) => {
    const numeric = head.classList.contains("n");
    const before = head.getAttribute("aria-sort");
    const order = before ? (before === "ascending" ? "descending" : "ascending") : numeric ? "descending" : "ascending";
    const sign = order === "ascending" ? 1 : -1;
    const keys = new Map(rows.map((row) => {
      const cell = row.cells[head.cellIndex];
      return [row, numeric ? parseFloat(cell.dataset.value) : cell.textContent];
    }));
    const compare = (one, other) => {
      const [a, b] = [keys.get(one), keys.get(other)];
      if (!numeric) return sign * words.compare(a, b);
      if (Number.isNaN(a) || Number.isNaN(b)) return Number.isNaN(a) - Number.isNaN(b); // what is missing comes last
      return a === b ? 0 : sign * (a < b ? -1 : 1);
    };
    body.append(...Array.from(rows).sort(compare));
    for (const one of box.querySelectorAll("thead th")) one.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", order);
  };

  for (const head of box.querySelectorAll("thead th")) {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    button.addEventListener("click", () => sort(head));
    head.append(button);
  }
  input.addEventListener("input", filter);
  tools.hidden = false;
  filter();
}
