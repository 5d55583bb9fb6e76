for (const table of document.querySelectorAll("table")) {
  const heads = [...table.tHead.rows[0].cells];
  const body = table.tBodies[0];
  heads.forEach((head, column) => {
    head.firstElementChild.addEventListener("click", () => {
      const number = [...body.rows].some(r => "value" in r.cells[column].dataset);
      // Figures sort from the best down at first, words from A.
      const next = head.ariaSort
        ? (head.ariaSort === "ascending" ? "descending" : "ascending")
        : (number ? "descending" : "ascending");
      heads.forEach(h => h.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", next);
      const sign = next === "ascending" ? 1 : -1;
      const key = row => number
        ? Number(row.cells[column].dataset.value ?? -1)
        : row.cells[column].textContent;
      const rows = [...body.rows].sort((a, b) => {
        const [x, y] = [key(a), key(b)];
        return sign * (number ? x - y : x.localeCompare(y, "en", {numeric: true}));
      });
      body.append(...rows);
    });
  });
}
