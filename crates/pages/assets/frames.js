// Turns strips of pictures into sequences with a slider.
for (const figure of document.querySelectorAll("figure.frames")) {
  const strip = figure.querySelector(".strip");
  const frames = [...strip.children];
  strip.classList.add("one");
  strip.removeAttribute("tabindex");
  // The slider fetches pictures in time: none may still be missing when it is its turn.
  for (const frame of frames) frame.querySelector("img").loading = "eager";
  addControls(figure, frames.map((frame) => frame.dataset.label), (k) => {
    frames.forEach((frame, j) => (frame.hidden = j !== k));
  });
}
