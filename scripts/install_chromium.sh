#!/bin/sh
# A Chromium for the tests of the report, where there is none. `make test` runs this.
set -eu
for name in chromium chromium-browser google-chrome; do
  command -v "$name" >/dev/null && exit 0
done
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
  (apt-get update -qq &&
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium) \
    >/dev/null 2>&1 && exit 0
fi
echo "no Chromium: the tests of the report in a browser will be skipped" \
  "(Debian or Ubuntu: sudo apt install chromium)" >&2
