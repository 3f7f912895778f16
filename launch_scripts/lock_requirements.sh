#!/usr/bin/env bash
# Rewrite requirements/locked/: the pins of requirements/ with the hashes of all their files.
#
#   launch_scripts/lock_requirements.sh [--check]
#
# --check writes nothing, and fails where a hash or a pin is another than the package index says.
# Needs uv: `pip install uv`.
set -euo pipefail
cd "$(dirname "$0")/requirements"
written=locked
if [[ ${1:-} == --check ]]; then
  written=$(mktemp -d)
  trap 'rm -rf "$written"' EXIT
fi
for pins in *.txt; do
  uv pip compile --quiet --no-deps --universal --python-version 3.11 --generate-hashes \
    --no-header --no-annotate "$pins" --output-file "$written/$pins" >/dev/null
done
diff -r locked "$written"
