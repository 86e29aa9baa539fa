# What tools/quickstart and tools/test share. To be sourced; ROOT is the root of the tree.

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
STARTED=$SECONDS

die() {
  printf '%s: %s\n' "$(basename "$0")" "$1" >&2
  exit "${2:-1}"
}

# stage 1/4 "text": what is being done, and since when.
stage() { printf '[%s] %s (%d s)\n' "$1" "$2" $((SECONDS - STARTED)); }

# The packages of the given groups that are not installed.
missing_packages() {
  local group package
  while read -r group package; do
    [[ $group == "" || $group == \#* || " $* " != *" $group "* ]] && continue
    [[ $(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null) == installed ]] || printf '%s ' "$package"
  done <"$ROOT/tools/packages.txt"
}

as_root() {
  if ((EUID == 0)); then
    env DEBIAN_FRONTEND=noninteractive "$@"
  else
    sudo env DEBIAN_FRONTEND=noninteractive "$@"
  fi
}

# apt_get <log> <arguments>: on failure one line with apt's own first complaint.
apt_get() {
  local log=$1
  shift
  as_root apt-get -q -o DPkg::Lock::Timeout=300 "$@" >"$log" 2>&1 && return
  die "apt-get $1 failed: $(grep -m1 '^E:' "$log" || tail -n 1 "$log"); the whole log is $log" 5
}

# install_packages yes|no <groups>: installs what is missing of them; with "no" it only looks.
install_packages() {
  local allowed=$1 missing package log="$ROOT/build/packages.log"
  shift
  if ! command -v dpkg-query >/dev/null; then
    [[ $allowed == no ]] && return # not Debian: CMake will say what it does not find
    die "this is no Debian machine; install what tools/packages.txt lists, then pass --no-install" 5
  fi
  missing=$(missing_packages "$@")
  [[ $missing == "" ]] && return
  [[ $allowed == yes ]] || die "not installed: $missing(leave out --no-install, or apt-get install them)" 5
  ((EUID == 0)) || command -v sudo >/dev/null || die "not installed: $missing(run as root, or install sudo)" 5
  mkdir -p "$ROOT/build"
  apt_get "$log" update
  for package in $missing; do
    [[ $(apt-cache policy "$package") == *Candidate:* && $(apt-cache policy "$package") != *"Candidate: (none)"* ]] ||
      die "Debian package $package cannot be had: no package list of this machine has it" 5
  done
  printf '      installing %s\n' "$missing"
  # shellcheck disable=SC2086  # a list of words
  apt_get "$log" install -y --no-install-recommends $missing
}

# ccache makes a second build quick; it is used where it is installed.
use_ccache() {
  if command -v ccache >/dev/null; then export CMAKE_CXX_COMPILER_LAUNCHER=ccache; fi
}
