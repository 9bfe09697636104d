#!/usr/bin/env bash
# Build wheel and sdist, install the wheel built from the sdist into an empty environment of every Python here that the
# project supports, and there, outside the clone: the quick tests and the commands on the packaged data.
set -euo pipefail
clone="$(cd "$(dirname "$0")/../.." && pwd)"
builder="${1:-python3}" # a Python with hatchling
work="$(mktemp --directory)"
trap 'rm -rf "$work"' EXIT

(cd "$clone" && "$builder" -m hatchling build --target sdist --directory "$work/dist")
tar --extract --gzip --file "$work"/dist/*.tar.gz --directory "$work"
(cd "$work"/damping_selection-*/ && "$builder" -m hatchling build --target wheel --directory "$work/dist")
ls -l "$work/dist"

# where pyenv is, all its versions answer to their names
if command -v pyenv >/dev/null; then
	PYENV_VERSION="$(pyenv versions --bare | paste --serial --delimiters=:)"
	export PYENV_VERSION
fi
try_version() { # what its Python runs, in its own processes
	local version="$1" python="$2"
	echo "Python $version: installing into an empty environment"
	"$python" -m venv "$work/env$version"
	bin="$work/env$version/bin"
	"$bin/python" -m pip install --quiet --disable-pip-version-check --no-compile --constraint "$clone/constraints.txt" \
		"$work"/dist/*.whl pytest hypothesis
	# the tests and the tables they compare with, without the packages: those must come from the wheel
	mkdir "$work/try$version"
	cp -r "$clone/tests" "$clone/data" "$clone/pyproject.toml" "$work/try$version"
	cd "$work/try$version"
	"$bin/python" -c 'import damping, sys; assert damping.__file__.startswith(sys.prefix), damping.__file__'
	"$bin/python" -m pytest -p no:cacheprovider -m "not sampling" tests/forces tests/contract tests/records/test_reading.py \
		tests/records/test_mode.py tests/reed1970/test_report_tables.py tests/regression tests/infer/test_likelihood.py
	rm -r data tests
	"$bin/damping" --help >/dev/null
	"$bin/python" -c 'from damping_pipelines.study_files import default_study; print(default_study())'
	data="$("$bin/python" -c 'from damping_reed1970 import data_folder; print(data_folder() / "saturn-v")')"
	"$bin/damping" rank "$data/records/config-2-mode-1.csv" --mode "$data/modes/config-2-mode-1.toml" --json rank.json >/dev/null 2>&1
	# every house runs: a study of one record, the generator with its scorer
	cat >study.toml <<-END
		title = "one record"
		[[records]]
		name = "rough"
		record = "$data/records/config-1-mode-2-rough.csv"
		mode = "$data/modes/config-1-mode-2-rough.toml"
		laws = [["viscous"]]
	END
	"$bin/damping" --quiet study study.toml --out study >/dev/null
	"$bin/damping" verify study
	"$bin/damping" --quiet blind --cases 2 --jobs 1 --out blind >/dev/null
	# the install is bare: what needs more says so, and runs with it
	if said="$("$bin/damping" fleet "$clone/examples" --out fleet 2>&1)" || ! grep --quiet "\[fleet\]" <<<"$said"; then
		echo "a bare install does not say what the fleet needs: $said" >&2
		exit 1
	fi
	"$bin/python" -m pip install --quiet --disable-pip-version-check --no-compile --constraint "$clone/constraints.txt" \
		"$(echo "$work"/dist/*.whl)[fleet,formats]"
	mkdir records
	cp "$data/records/config-2-mode-1.csv" "$data/modes/config-2-mode-1.toml" records
	"$bin/damping" --quiet fleet records --out fleet --fast --workers 0 >/dev/null
	# a calibration, --quick too, takes too long here: that it answers stands for it
	"$bin/damping" calibrate --help >/dev/null
}

# all versions at once: one process of each, on as many cores as there are
declare -A running
for version in ${VERSIONS:-3.11 3.12 3.13}; do
	python="$(command -v "python$version" || true)"
	if [ -z "$python" ] || ! "$python" -c "" 2>/dev/null; then
		echo "Python $version is not installed here: not tried"
		continue
	fi
	(try_version "$version" "$python") >"$work/log$version" 2>&1 &
	running[$version]=$!
done
failed=0
for version in "${!running[@]}"; do
	wait "${running[$version]}" || { failed=1 && echo "Python $version: failed" >>"$work/log$version"; }
	cat "$work/log$version"
done
echo "wheel tried on ${#running[@]} version(s) of Python"
[ "${#running[@]}" -gt 0 ] && [ "$failed" -eq 0 ]
