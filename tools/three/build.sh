#!/usr/bin/env bash
# Makes tisoft/viewer/page/three.min.js, the part of three.js 0.187 that the page uses (esbuild 0.28).
# Needs npm; only who renews the file runs it.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp "$here/entry.js" "$work/entry.js"
cd "$work"
npm init -y >/dev/null
npm install --silent three@0.187 esbuild@0.28
npx esbuild entry.js --bundle --minify --format=esm --legal-comments=none \
    --outfile="$here/../../tisoft/viewer/page/three.min.js"
cp node_modules/three/LICENSE "$here/../../tisoft/viewer/page/three.LICENSE"
