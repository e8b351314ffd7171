// The strip of all images: each picture is decoded when it comes into sight.

const LEAST_TO_FIND = 12;

function startGallery() {
  const strip = byId("strip");
  const sight = new IntersectionObserver(loadSeen, { root: strip, rootMargin: "0px 300px" });
  report.images.forEach((image, index) => {
    const picture = make("img", { className: "blank", alt: "", decoding: "async" });
    const button = make(
      "button",
      { type: "button", title: image.name },
      picture,
      make("span", { textContent: `\u2066${image.name}\u2069` }),
    );
    button.dataset.index = index;
    button.addEventListener("click", () => chooseImage(index));
    strip.append(make("li", {}, button));
    sight.observe(button);
  });
  strip.addEventListener("keydown", moveAlongStrip);
  byId("previous").addEventListener("click", () => chooseImage(stage.index - 1));
  byId("next").addEventListener("click", () => chooseImage(stage.index + 1));
  byId("find").hidden = report.images.length < LEAST_TO_FIND;
  byId("find-text").addEventListener("input", (event) => find(event.target.value));
  window.addEventListener("hashchange", chooseByHash);
  if (report.images.length === 1) [strip, byId("previous"), byId("next")].forEach((e) => (e.hidden = true));
  if (!chooseByHash()) chooseImage(0, false);
}

function loadSeen(entries, observer) {
  for (const { isIntersecting, target } of entries) {
    if (!isIntersecting) continue;
    target.querySelector("img").src = blockImageUrl(`image-${target.dataset.index}-photo`);
    observer.unobserve(target);
  }
}

function chooseImage(index, isAsked = true) {
  const number = report.images.length;
  const chosen = (index + number) % number;
  const buttons = byId("strip").querySelectorAll("button");
  buttons.forEach((button, i) => {
    button.tabIndex = i === chosen ? 0 : -1; // the arrow keys go to the others
    if (i === chosen) button.setAttribute("aria-current", "true");
    else button.removeAttribute("aria-current");
  });
  showInStrip(buttons[chosen]);
  if (isAsked) history.replaceState(null, "", `#image-${chosen + 1}`);
  showImage(chosen);
}

// Not scrollIntoView: it would also scroll the page.
function showInStrip(button) {
  const strip = byId("strip");
  const item = button.parentElement;
  strip.scrollLeft = item.offsetLeft - strip.offsetLeft - (strip.clientWidth - item.offsetWidth) / 2;
}

function chooseByHash() {
  const found = /^#image-(\d+)$/.exec(location.hash);
  if (!found || found[1] < 1 || found[1] > report.images.length) return false;
  chooseImage(found[1] - 1, false);
  byId("images").scrollIntoView();
  return true;
}

function moveAlongStrip(event) {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (!step) return;
  event.preventDefault();
  const shown = [...byId("strip").querySelectorAll("li:not([hidden]) button")];
  const at = shown.indexOf(document.activeElement);
  const next = shown[(at + step + shown.length) % shown.length];
  next.focus();
  chooseImage(Number(next.dataset.index));
}

function find(text) {
  const wanted = text.trim().toLowerCase();
  report.images.forEach((image, index) => {
    byId("strip").children[index].hidden = !image.name.toLowerCase().includes(wanted);
  });
}
