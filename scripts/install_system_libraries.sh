#!/bin/sh
# The shared libraries that open3d's wheel expects of the system. `make` runs this where
# open3d cannot be imported.
set -eu
packages="libegl1 libgl1 libgomp1 libusb-1.0-0 libx11-6"
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
  apt-get update -qq
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $packages
else
  echo "open3d needs system libraries; on Debian or Ubuntu: sudo apt install $packages" >&2
  exit 1
fi
