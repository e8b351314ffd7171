#!/bin/sh
# Fetch the libraries that the report embeds, at the versions below, and bundle the part
# of three.js that it uses. Needs npm and a network; the result is committed.
set -eu
three=0.187.0
uplot=1.6.32
esbuild=0.28.2
target="$(cd "$(dirname "$0")/.." && pwd)/resdepth_colmap/report/assets/vendor"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init --yes >/dev/null
npm install --silent --save-exact "three@$three" "uplot@$uplot" "esbuild@$esbuild"
cat > entry.js <<'EOF'
export {
  BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments, PerspectiveCamera,
  Points, PointsMaterial, Scene, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
EOF
banner="/*! three.js $three, (c) 2010-2026 three.js authors, MIT licence */"
npx esbuild entry.js --bundle --minify --format=iife --global-name=THREE --target=es2020 \
  --legal-comments=none --banner:js="$banner" --log-level=warning \
  --outfile="$target/three.min.js"
banner="/*! uPlot $uplot, (c) 2022 Leon Sorokin, MIT licence */"
(echo "$banner"; cat node_modules/uplot/dist/uPlot.iife.min.js) > "$target/uPlot.iife.min.js"
cp node_modules/uplot/dist/uPlot.min.css "$target/uPlot.min.css"
{
  echo "Libraries of others in this folder, both embedded in each report."
  echo "Fetched and bundled by scripts/vendor_report_libraries.sh."
  echo
  echo "three.min.js: three.js $three with OrbitControls (https://threejs.org), the used part"
  echo
  cat node_modules/three/LICENSE
  echo
  echo "uPlot.iife.min.js, uPlot.min.css: uPlot $uplot (https://github.com/leeoniya/uPlot)"
  echo
  cat node_modules/uplot/LICENSE
} > "$target/NOTICE.txt"
