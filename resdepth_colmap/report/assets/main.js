// Light or dark, and the start of everything.

const THEME_KEY = "resdepth-report-theme";

function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

function themeChanged() {
  byId("theme").textContent = isDark() ? "Light" : "Dark";
  byId("theme").setAttribute("aria-label", `Change to ${isDark() ? "light" : "dark"} colours`);
  recolorCharts();
}

function startTheme() {
  const root = document.documentElement;
  try {
    root.dataset.theme = localStorage.getItem(THEME_KEY) ?? "";
  } catch {
    // Some browsers keep nothing for local files.
  }
  if (!["light", "dark"].includes(root.dataset.theme)) delete root.dataset.theme;
  byId("theme").addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    try {
      localStorage.setItem(THEME_KEY, root.dataset.theme);
    } catch {
      // As above.
    }
    themeChanged();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", themeChanged);
  themeChanged();
}

// The cloud is decoded and drawn when it is about to be seen.
function startCloudInSight() {
  const sight = new IntersectionObserver(
    (entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      sight.disconnect();
      startCloud();
    },
    { rootMargin: "600px" },
  );
  sight.observe(byId("cloud"));
}

startTheme();
showSummary();
startStage();
startGallery();
startTable();
startCloudInSight();
new ResizeObserver(resizeCharts).observe(byId("depth-chart"));
