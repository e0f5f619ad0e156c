"use strict";
/* The plates of the page: a card for each with what it shows first, its caption below the viewer, all of them on paper. */
(() => {
  const buttons = [...document.querySelectorAll(".strip button")], articles = [...document.querySelectorAll(".captions article")];
  const { viewer } = window;
  const select = (number) => {
    const button = buttons.find((each) => each.dataset.plate === number) ?? buttons[0];
    viewer.show(Number(button.dataset.first));
  };
  const mark = () => {
    const { plate } = viewer.scene().at;
    buttons.forEach((button, i) => {
      const current = button.querySelector("span").textContent === plate;
      button.setAttribute("aria-current", current);
      articles[i].classList.toggle("current", current);
    });
  };
  const hashed = () => location.hash.replace("#figure", "");
  if (!viewer) {
    for (const article of articles) article.classList.add("current");
    return;
  }
  for (const button of buttons) button.addEventListener("click", () => {
    history.replaceState(null, "", `#figure${button.dataset.plate}`);
    select(button.dataset.plate);
  });
  document.addEventListener("shown", mark);
  addEventListener("hashchange", () => select(hashed()));
  if (hashed()) select(hashed()); else mark();

  /* Visits every plate, the one that is shown as it is, and comes back. */
  const visit = (density, done) => {
    const { scene, turn, zoom, shift } = viewer.state, shown = viewer.scene().at.plate;
    const back = () => { viewer.show(scene); Object.assign(viewer.state, { turn, zoom, shift }); };
    buttons.forEach((button, i) => {
      if (button.querySelector("span").textContent === shown) back(); else viewer.show(Number(button.dataset.first));
      viewer.paint(density);
      done(i);
    });
    back();
    viewer.paint(Math.min(devicePixelRatio || 1, 2));
  };
  const canvas = document.getElementById("canvas");
  viewer.ready.then(() => setTimeout(() => visit(0.6, (i) => {
    const small = buttons[i].querySelector("canvas"), scale = Math.min(small.width / canvas.width, small.height / canvas.height);
    const [w, h] = [canvas.width * scale, canvas.height * scale];
    small.getContext("2d").drawImage(canvas, (small.width - w) / 2, (small.height - h) / 2, w, h);
  }), 50)).then(() => { document.body.dataset.plates = "ready"; });

  addEventListener("beforeprint", () => visit(2, (i) => {
    const image = articles[i].querySelector("img");
    image.src = canvas.toDataURL("image/png");
    image.hidden = false;
  }));
  addEventListener("afterprint", () => { for (const article of articles) article.querySelector("img").hidden = true; });
})();
