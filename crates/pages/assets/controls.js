// A play button and a slider below the pictures of a figure. `show(k)` is called at every change;
// the labels say what is shown.
function addControls(figure, labels, show) {
  const row = document.createElement("div");
  row.className = "controls";
  const play = document.createElement("button");
  play.type = "button";
  const slider = document.createElement("input");
  slider.type = "range";
  slider.min = 0;
  slider.max = labels.length - 1;
  slider.value = 0;
  slider.setAttribute("aria-label", "Step");
  const label = document.createElement("output");
  row.append(play, slider, label);

  let timer = 0;
  const update = () => {
    const k = Number(slider.value);
    label.textContent = labels[k];
    slider.setAttribute("aria-valuetext", labels[k]);
    show(k);
  };
  const stop = () => {
    clearInterval(timer);
    timer = 0;
    play.textContent = "Play";
  };
  const advance = () => {
    slider.stepUp();
    update();
    if (slider.value === slider.max) stop();
  };
  play.addEventListener("click", () => {
    if (timer) return stop();
    if (slider.value === slider.max) slider.value = 0;
    update();
    play.textContent = "Pause";
    // About six seconds for all, but no faster than 25 pictures a second nor slower than two.
    timer = setInterval(advance, Math.min(500, Math.max(40, 6000 / labels.length)));
  });
  slider.addEventListener("input", () => {
    stop();
    update();
  });
  stop();
  update();
  figure.insertBefore(row, figure.querySelector("figcaption"));
  // For other scripts: shows one step.
  return (k) => {
    slider.value = k;
    update();
  };
}
