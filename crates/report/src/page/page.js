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
      const key = row => {
        const cell = row.cells[column];
        if (number) return "value" in cell.dataset ? Number(cell.dataset.value) : null;
        return cell.textContent || null;
      };
      // What is missing stays last in both directions.
      const compare = (x, y) => x === null || y === null
        ? (x === null) - (y === null)
        : sign * (number ? x - y : x.localeCompare(y, "en", {numeric: true}));
      body.append(...[...body.rows].sort((a, b) => compare(key(a), key(b))));
    });
  });
}
// A head sticks to the top of the window only where its table does not scroll by itself.
const fit = new ResizeObserver(entries => {
  for (const {target} of entries) {
    target.classList.remove("fits");
    target.classList.toggle("fits", target.scrollWidth <= target.clientWidth + 1);
  }
});
document.querySelectorAll(".scroll").forEach(box => fit.observe(box));
// What sticks below the navigation must know how high it is.
const nav = document.querySelector("nav");
new ResizeObserver(() => {
  document.documentElement.style.setProperty("--nav", `${nav.offsetHeight}px`);
}).observe(nav);
// On paper nothing can be unfolded.
let closed = [];
addEventListener("beforeprint", () => {
  closed = [...document.querySelectorAll("details:not([open])")];
  closed.forEach(part => { part.open = true; });
});
addEventListener("afterprint", () => closed.forEach(part => { part.open = false; }));
