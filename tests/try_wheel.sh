#!/bin/sh
# Installs a source distribution and a wheel outside the repository and tests the wheel there.
#
#   sh tests/try_wheel.sh PYTHON DIST
#
# PYTHON has the dependencies, which are lent to the new environment; DIST holds the two files.
set -eu
python=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
dist=$(cd "$2" && pwd)
repository=$(cd "$(dirname "$0")/.." && pwd)
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
unset PYTHONPATH

# What must be in a wheel: every file of the packages.
(cd "$repository" && find spinlev -type f && find scenes geometry fem dynamics studies -type f | sed 's|^|spinlev/|') |
  grep -v __pycache__ > "$place/tree.txt"
cp -r "$repository/tests" "$repository/scenes" "$repository/pyproject.toml" "$place"
cd "$place"
export SPINLEV_CACHE="$place/cache"

for file in "$dist"/*.tar.gz "$dist"/*.whl; do
  echo "== $(basename "$file")"
  rm -rf venv
  "$python" -m venv --without-pip venv
  own=$(venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
  "$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))' > "$own/lent.pth"
  "$python" -m pip --python venv/bin/python install --quiet --disable-pip-version-check --no-index --no-deps \
    --no-build-isolation --ignore-installed "$file"
  venv/bin/python - "$own" <<'PYTHON'
import sys
from importlib.metadata import distribution
from pathlib import Path

from spinlev import dynamics, fem, geometry, studies

homes = {str(Path(package.__file__).parents[2]) for package in (geometry, fem, dynamics, studies)}
assert homes == {sys.argv[1]}, homes
files = {str(file) for file in distribution("spinlev").files}
tree = {line.strip() for line in open("tree.txt")}
packed = {file for file in files if file.startswith("spinlev/") and "__pycache__" not in file}
assert packed == tree, packed ^ tree
print("installed:", len([file for file in files if file.endswith(".py")]), "modules in", sys.argv[1])
PYTHON
  venv/bin/spinlev equilibria scenes/vertical-24h.toml --model dipole --json --out out > answer.json
  venv/bin/python -c 'import json; print("distance", json.load(open("answer.json"))["equilibria"][0]["position_mm"][2], "mm")'
done
venv/bin/python -m pytest -q -m "not slow" -p no:cacheprovider tests/fem/closed_forms/test_closed_form.py \
  tests/geometry/scene/test_scene_file.py tests/dynamics/flights/test_integration.py tests/studies/test_sweep.py \
  tests/studies/test_api.py tests/studies/cli/test_command_line.py
