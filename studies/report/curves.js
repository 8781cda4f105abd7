// Tables of curves: a heading sorts by its column, ticks say which curves the charts beside it draw.
for (const group of document.querySelectorAll(".curves")) {
  const body = group.querySelector("tbody");
  const boxes = [...body.querySelectorAll("input")];

  const draw = () => {
    const picked = new Set(boxes.filter(box => box.checked).map(box => box.value));
    for (const chart of group.querySelectorAll(".js-plotly-plot")) {
      const visible = chart.data.map(trace => trace.meta.curves.some(name => picked.has(name)));
      Plotly.restyle(chart, {visible});
    }
  };
  boxes.forEach(box => box.addEventListener("change", draw));

  const rows = [...body.rows];
  if (rows.length < 2) continue;
  const value = (row, column) => parseFloat(row.cells[column].textContent.replace("−", "-"));
  group.querySelectorAll("th").forEach((heading, column) => {
    const button = document.createElement("button");
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => {
      const down = heading.ariaSort === "ascending";
      group.querySelectorAll("th").forEach(other => other.removeAttribute("aria-sort"));
      heading.ariaSort = down ? "descending" : "ascending";
      // what is no number comes last, either way; the first column in the order in which curves were computed
      const key = row => column ? value(row, column) : Number(row.dataset.place);
      const sign = down ? -1 : 1;
      const compare = (a, b) => isNaN(key(a)) - isNaN(key(b)) || sign * (key(a) - key(b));
      body.append(...[...body.rows].sort(compare));
    });
  });
}
