"use strict";
/* The cells of the heat map open what is behind them. */
(() => {
  const dialog = document.getElementById("cell");
  if (!dialog) return;
  const details = JSON.parse(document.getElementById("cells").textContent);
  const svg = dialog.closest("section").querySelector("svg");
  const part = (name) => document.getElementById(`cell-${name}`);
  const make = (tag, text, className = "") => Object.assign(document.createElement(tag), { textContent: text, className });

  /* Mean Change Percentage by strength, with that of the reference. */
  const drawCurve = (own, reference) => {
    const figure = part("curve");
    figure.hidden = !own.length;
    const [left, right, top, bottom] = [44, 550, 14, 122];
    const high = Math.max(...[...own, ...reference].map((each) => each[1]), 1);
    const x = (i) => left + 10 + (own.length > 1 ? i / (own.length - 1) : 0.5) * (right - left - 20);
    const y = (value) => bottom - (value / high) * (bottom - top);
    const element = (tag, attributes, text = "") => {
      const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
      for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
      made.textContent = text;
      return made;
    };
    const line = (values, style) => element("polyline", {
      class: style, points: values.map((each, i) => `${x(i).toFixed(1)},${y(each[1]).toFixed(1)}`).join(" "),
    });
    const level = (i) => element("text", { x: x(i), y: bottom + 18, "text-anchor": "middle" }, String(own[i][0]));
    figure.firstElementChild.replaceChildren(
      element("path", { class: "axis", d: `M${left} ${top}V${bottom}H${right}`, fill: "none" }),
      element("text", { x: left - 6, y: top + 5, "text-anchor": "end" }, high.toFixed(high < 10 ? 1 : 0)),
      element("text", { x: left - 6, y: bottom + 4, "text-anchor": "end" }, "0"),
      line(reference, "reference"), line(own, "own"),
      ...own.map((each, i) => element("circle", { cx: x(i), cy: y(each[1]), r: 4 })),
      ...own.map((each, i) => level(i)),
    );
  };

  const open = (cell) => {
    const shown = details[`${cell.dataset.row} ${cell.dataset.column}`];
    part("title").textContent = shown.title;
    part("facts").textContent = shown.facts.join("; ");
    drawCurve(shown.curve, shown.reference);
    part("worst").hidden = !shown.worst.length;
    part("worst").tBodies[0].replaceChildren(...shown.worst.map(([model, change, level, repeat, scene]) => {
      const row = document.createElement("tr");
      const last = make("td", "");
      if (scene >= 0 && window.viewer) {
        const button = make("button", "show", "show");
        button.type = "button";
        button.addEventListener("click", () => {
          dialog.close();
          showMethod(shown.method, scene);
        });
        last.append(button);
      }
      row.append(make("td", model), make("td", change, "number"), make("td", level), make("td", repeat, "number"), last);
      return row;
    }));
    part("failures").replaceChildren(...shown.failures.map((each) => make("li", each)));
    dialog.showModal();
  };

  /* A scene with the surfaces of one method alone. */
  const showMethod = (method, scene) => {
    for (const label of document.querySelectorAll("#rows label")) {
      const box = label.querySelector("input");
      const wanted = label.textContent === method;
      if (box.checked !== wanted) box.click();
    }
    window.viewer.show(scene);
    document.getElementById("viewer").scrollIntoView({ block: "nearest" });
  };

  // One cell can be reached by the tabulator key, the others from there by arrows.
  const cells = [...svg.querySelectorAll("rect.cell")];
  const at = new Map(cells.map((cell) => [`${cell.dataset.row} ${cell.dataset.column}`, cell]));
  const STEPS = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };
  cells.forEach((cell, i) => {
    cell.setAttribute("role", "button");
    cell.setAttribute("aria-label", cell.dataset.tip);
    cell.setAttribute("tabindex", i ? -1 : 0);
  });
  svg.addEventListener("click", (event) => event.target.matches("rect.cell") && open(event.target));
  svg.addEventListener("keydown", (event) => {
    const cell = event.target.closest("rect.cell");
    if (!cell) return;
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      open(cell);
    } else if (STEPS[event.key]) {
      event.preventDefault();
      const [down, right] = STEPS[event.key];
      const next = at.get(`${Number(cell.dataset.row) + down} ${Number(cell.dataset.column) + right}`);
      if (!next) return;
      cell.setAttribute("tabindex", -1);
      next.setAttribute("tabindex", 0);
      next.focus();
    }
  });
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
})();
