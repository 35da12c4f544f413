"use strict";
(() => {
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const repetitions = JSON.parse(document.getElementById("repetitions").textContent);

  // Tables: a press on a heading sorts by it, another one the other way round.
  const number = (cell) => (cell.dataset.v === undefined ? null : Number(cell.dataset.v));
  const compare = (a, b) => {
    const [x, y] = [number(a), number(b)];
    if (x !== null && y !== null) return x - y;
    if (x !== null || y !== null) return NaN; // one has no value: it goes last, either way
    return a.textContent.localeCompare(b.textContent, undefined, { numeric: true });
  };
  function sort(heading) {
    const table = heading.closest("table");
    const place = heading.cellIndex;
    const up = heading.getAttribute("aria-sort") !== "ascending";
    for (const other of all("th[aria-sort]", table)) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", up ? "ascending" : "descending");
    const body = table.tBodies[0];
    const rows = [...body.rows].filter((row) => !row.classList.contains("fixed"));
    rows.sort((a, b) => {
      const found = compare(a.cells[place], b.cells[place]);
      if (Number.isNaN(found)) return number(a.cells[place]) === null ? 1 : -1;
      return up ? found : -found;
    });
    body.append(...rows);
  }
  for (const button of all("table.data thead button")) {
    button.addEventListener("click", () => sort(button.closest("th")));
  }

  // Filters: by simulator, mode and profile.
  const form = document.getElementById("filters");
  function filter() {
    const chosen = {};
    for (const box of all("input", form)) {
      (chosen[box.name] ??= new Set()).add(box.checked ? box.value : null);
    }
    let shown = 0;
    const lines = all("main [data-simulator]");
    for (const line of lines) {
      line.hidden = Object.entries(chosen).some(([name, values]) => !values.has(line.dataset[name]));
      shown += line.matches("tr") && !line.hidden;
    }
    const rows = lines.filter((line) => line.matches("tr")).length;
    document.getElementById("shown").textContent =
      shown === rows ? "" : `${shown} of ${rows} lines of all tables are shown`;
  }
  if (form) {
    form.addEventListener("change", filter);
    form.addEventListener("submit", (event) => event.preventDefault());
    filter();
  }

  // Dots: pointing at one or stepping to it tells which repetition it is; a press keeps it.
  const detail = document.getElementById("detail");
  let kept = null;
  function element(kind, text, attributes = {}) {
    const made = Object.assign(document.createElement(kind), attributes);
    made.textContent = text;
    return made;
  }
  function show(dot) {
    const found = repetitions[Number(dot.dataset.n)];
    const metric = all("figcaption b", dot.closest("figure"))[0].textContent;
    const lines = [
      element("b", `${found.of}, ${found.task}`),
      element("span", `${metric}: ${dot.dataset.value || "no value"}`),
      element("span", `repetition ${found.repetition}, seed ${found.seed}, ${found.status}`),
    ];
    if (found.cause) lines.push(element("span", found.cause));
    if (found.log) {
      const line = element("span", "log: ");
      const plain = /^logs\/[A-Za-z0-9_=-][A-Za-z0-9_.=-]*\.log$/.test(found.log);
      line.append(plain ? element("a", found.log, { href: found.log }) : element("code", found.log));
      lines.push(line);
    }
    for (const name of ["replay", "video"]) {
      if (!found[name]) continue;
      const line = element("span", "");
      line.append(element("a", name, { href: found[name] }));
      lines.push(line);
    }
    if (found.command) {
      const line = element("span", "the same seed again: ");
      line.append(element("code", found.command));
      lines.push(line);
    }
    const close = element("button", "\u00d7", { type: "button", ariaLabel: "close" });
    close.addEventListener("click", hide);
    detail.replaceChildren(close, ...lines);
    detail.hidden = false;
    for (const other of all(".dot.current")) other.classList.remove("current");
    for (const twin of all(`.dot[data-n="${dot.dataset.n}"]`)) twin.classList.add("current");
  }
  function hide() {
    kept = null;
    detail.hidden = true;
    for (const other of all(".dot.current")) other.classList.remove("current");
  }
  function step(dot, key) {
    const dots = all(".dot", dot.closest(".lane"));
    const place = dots.indexOf(dot);
    if (key === "ArrowRight") return dots[place + 1];
    if (key === "ArrowLeft") return dots[place - 1];
    if (key === "Home") return dots[0];
    if (key === "End") return dots.at(-1);
    const lanes = all(".lane:not([hidden]):not(.axis)", dot.closest("figure"));
    const lane = lanes[lanes.indexOf(dot.closest(".lane")) + (key === "ArrowDown" ? 1 : -1)];
    return lane && all(".dot", lane)[Math.min(place, all(".dot", lane).length - 1)];
  }
  function focus(dot) {
    for (const other of all(".dot", dot.closest(".lane"))) other.setAttribute("tabindex", "-1");
    dot.setAttribute("tabindex", "0");
    dot.focus();
  }
  for (const lane of all(".lane")) {
    // One stop of the tabulator for each line; the arrow keys go from dot to dot.
    all(".dot", lane).forEach((dot, place) => {
      const found = repetitions[Number(dot.dataset.n)];
      dot.setAttribute("tabindex", place ? "-1" : "0");
      dot.setAttribute("role", "button");
      const value = dot.dataset.value || "no value";
      dot.setAttribute("aria-label", `repetition ${found.repetition}, seed ${found.seed}: ${value}`);
    });
  }
  const dotOf = (event) => (event.target.closest ? event.target.closest(".dot") : null);
  document.addEventListener("pointerover", (event) => {
    const dot = dotOf(event);
    if (dot && kept === null && event.pointerType === "mouse") show(dot);
  });
  document.addEventListener("focusin", (event) => {
    const dot = dotOf(event);
    if (dot) show(dot);
  });
  document.addEventListener("click", (event) => {
    const dot = dotOf(event);
    if (!dot) return;
    kept = dot;
    show(dot);
  });
  document.addEventListener("keydown", (event) => {
    const dot = dotOf(event);
    if (event.key === "Escape") return hide();
    if (!dot) return;
    if (event.key === "Enter" || event.key === " ") {
      kept = dot;
      show(dot);
    } else if (/^(Arrow|Home|End)/.test(event.key)) {
      const next = step(dot, event.key);
      if (next) focus(next);
    } else return;
    event.preventDefault();
  });

  // On paper everything is open.
  addEventListener("beforeprint", () => all("details").forEach((part) => (part.open = true)));
})();
