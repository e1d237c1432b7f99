// Pictures that are missing say so. Opened as page.html#check, the page also starts everything on it
// and leaves in `data-check` of its root element what did not work.
const shortened = (address) => (address.length > 80 ? address.slice(0, 77) + "..." : address);

function markMissing(image) {
  if (image.nextElementSibling?.classList.contains("note")) return;
  const note = document.createElement("p");
  note.className = "note";
  note.textContent = "This picture is missing: " + shortened(image.getAttribute("src"));
  image.after(note);
}

for (const image of document.images) {
  if (image.complete && image.naturalWidth === 0 && image.loading !== "lazy") markMissing(image);
  image.addEventListener("error", () => markMissing(image));
}

// What a viewer shows: the part of the picture that is covered, how many shades there are, and the larger part of a side that is taken.
function covered(viewer) {
  const { gl, canvas } = viewer;
  viewer.draw();
  const pixels = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let count = 0;
  const shades = new Set();
  const [low, high] = [[canvas.width, canvas.height], [0, 0]];
  for (let k = 0; k < pixels.length; k += 4) {
    if (pixels[k + 3] < 255) continue;
    count++;
    shades.add(pixels[k]);
    [(k / 4) % canvas.width, Math.floor(k / 4 / canvas.width)].forEach((place, i) => {
      low[i] = Math.min(low[i], place);
      high[i] = Math.max(high[i], place + 1);
    });
  }
  const taken = Math.max((high[0] - low[0]) / canvas.width, (high[1] - low[1]) / canvas.height);
  return { part: (4 * count) / pixels.length, shades: shades.size, taken };
}

// Nothing here waits: who reads the attribute after the page is loaded finds it.
function checkPage() {
  const problems = [];
  for (const image of document.images) {
    const name = shortened(image.getAttribute("src"));
    if (!image.complete || image.naturalWidth === 0) problems.push("broken picture " + name);
    if (!image.alt) problems.push("no text in place of " + name);
  }
  for (const viewer of typeof viewers === "undefined" ? [] : viewers) {
    const name = "viewer " + viewer.figure.dataset.caption;
    if (!viewer.start()) {
      problems.push(name + " does not start");
      continue;
    }
    let most = 0;
    viewer.blocks.forEach((block, k) => {
      if (viewer.show) viewer.show(k);
      const { part, shades, taken } = covered(viewer);
      most = Math.max(most, taken);
      if (part < 0.01 || part > 0.95 || shades < 8) {
        problems.push(`${name}, ${block.dataset.label}: ${(100 * part).toFixed(1)} % covered, ${shades} shades`);
      }
    });
    // The shape may grow or shrink; at its largest it fills the view.
    if (most < 0.8 || most >= 1) problems.push(`${name} takes ${(100 * most).toFixed(0)} % of its view`);
    viewer.show?.(0);
  }
  for (const link of document.querySelectorAll('a[href^="#"]')) {
    if (!document.getElementById(link.getAttribute("href").slice(1))) problems.push("nowhere: " + link.outerHTML);
  }
  const root = document.documentElement;
  if (root.scrollWidth > root.clientWidth) {
    problems.push(`${root.scrollWidth} wide in a window of ${root.clientWidth}`);
  }
  root.dataset.pictures = document.images.length;
  root.dataset.viewers = typeof viewers === "undefined" ? 0 : viewers.length;
  root.dataset.height = root.scrollHeight;
  root.dataset.check = problems.join("; ") || "passed";
}

if (location.hash === "#check") {
  // Pictures far below are fetched, too, before the page counts as loaded, and are there as soon as it is shown.
  for (const image of document.images) Object.assign(image, { loading: "eager", decoding: "sync" });
  addEventListener("load", () => {
    try {
      checkPage();
    } catch (error) {
      document.documentElement.dataset.check = "failed: " + error.message;
    }
  });
}
