"use strict";
/* Theme, tables that sort and filter, values on hover, and links to the scenes of the viewer. */
(() => {
  const root = document.documentElement;
  const remembered = (value) => {
    try {
      if (value !== undefined) localStorage.setItem("theme", value);
      return localStorage.getItem("theme");
    } catch { return null; } // a page that is opened from disk may have no storage
  };
  if (remembered()) root.dataset.theme = remembered();
  document.getElementById("theme").addEventListener("click", () => {
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
    remembered(root.dataset.theme);
    document.dispatchEvent(new Event("theme"));
  });

  const compare = (a, b) => {
    const [x, y] = [parseFloat(a), parseFloat(b)];
    if (a === "" || b === "") return (a === "") - (b === ""); // what is missing comes last
    return isNaN(x) || isNaN(y) ? a.localeCompare(b, undefined, { numeric: true }) : x - y;
  };
  for (const table of document.querySelectorAll("table.sortable")) {
    const body = table.tBodies[0];
    const headings = [...table.tHead.rows[0].cells];
    const original = [...body.rows];
    const order = (row, i) => row.cells[i].dataset.order;
    headings.forEach((heading, i) => heading.firstElementChild.addEventListener("click", () => {
      const next = { none: "ascending", ascending: "descending", descending: "none" }[heading.getAttribute("aria-sort")];
      for (const each of headings) each.setAttribute("aria-sort", "none");
      heading.setAttribute("aria-sort", next);
      const sign = next === "descending" ? -1 : 1;
      const rows = next === "none" ? original : [...original].sort((a, b) => {
        const [x, y] = [order(a, i), order(b, i)];
        return x === "" || y === "" ? compare(x, y) : sign * compare(x, y);
      });
      body.append(...rows);
    }));
    const input = table.closest("section").querySelector(".filter input");
    if (input) {
      const count = table.closest("section").querySelector(".count");
      input.addEventListener("input", () => {
        const words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
        let shown = 0;
        for (const row of original) {
          const text = row.textContent.toLowerCase();
          row.hidden = !words.every((word) => text.includes(word));
          shown += !row.hidden;
        }
        count.textContent = words.length ? `${shown} of ${original.length}` : "";
      });
    }
  }

  for (const button of document.querySelectorAll(".copy")) {
    button.addEventListener("click", async () => {
      const code = button.previousElementSibling;
      try {
        await navigator.clipboard.writeText(code.textContent);
        button.textContent = "copied";
      } catch { // not allowed: select it instead
        getSelection().selectAllChildren(code);
      }
    });
  }

  const tip = document.getElementById("tip");
  const showTip = (target, x, y) => {
    tip.textContent = target.dataset.tip;
    tip.hidden = false;
    const box = tip.getBoundingClientRect();
    tip.style.left = `${Math.max(4, Math.min(x + 12, innerWidth - box.width - 4))}px`;
    tip.style.top = `${y - box.height - 10 > 0 ? y - box.height - 10 : y + 16}px`;
  };
  document.addEventListener("pointermove", (event) => {
    const target = event.target.closest?.("[data-tip]");
    if (target) showTip(target, event.clientX, event.clientY);
    else tip.hidden = true;
  });
  document.addEventListener("focusin", (event) => {
    const target = event.target.closest?.("[data-tip]");
    if (target && target.matches(":focus-visible")) {
      const box = target.getBoundingClientRect();
      showTip(target, box.right, box.top);
    } else tip.hidden = true;
  });

  const show = (target) => {
    const button = target.closest?.("[data-scene]");
    if (!button || !window.viewer) return false;
    window.viewer.show(Number(button.dataset.scene));
    document.getElementById("viewer").scrollIntoView({ block: "nearest", behavior: "instant" });
    return true;
  };
  document.addEventListener("click", (event) => show(event.target));
  document.addEventListener("keydown", (event) => {
    if ((event.key === "Enter" || event.key === " ") && event.target.matches?.("circle[data-scene]") && show(event.target)) {
      event.preventDefault();
    }
  });
})();
