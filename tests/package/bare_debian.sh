#!/usr/bin/env bash
# The ways to use greybox-bms elsewhere, each in a Debian that has never seen the project. What is committed is tried.
#
#   bare_debian.sh FOLDER demo|test|package|install|find|subdirectory|cores|python
#   bare_debian.sh FOLDER compiler NAME...
#
#   demo          ./bms demo, a newcomer's first command
#   test          ./bms test, the second; in a root of its own, so that its seconds do not depend on demo
#   compiler      builds the tool and all tests of the host with each compiler (g++-12, clang-19, ...) and counts its
#                 warnings by option
#   package       makes the Debian package, installs it in another bare Debian, and uses tool, manual and completions
#   install       cmake --install into a prefix of its own; sources and build are then hidden
#   find          a project with find_package(greybox), with the package
#   subdirectory  a project with add_subdirectory(), and one with FetchContent
#   cores         the first project for a Cortex-M4F and a Cortex-M0, and the firmware of an emulated board
#   python        pip install --no-build-isolation with Debian's packages; the tests of the module
#
# FOLDER is made once by debootstrap, from this machine's package sources; each way works on a copy. package comes
# before install and what follows it: they use its package from FOLDER. Prints the seconds of each step, also those of
# all processors together, which depend less on other load. demo and test write their row into the README's status.
# BMS_DEBIAN is the release, bookworm if not given. CMAKE_BUILD_PARALLEL_LEVEL limits the processes of a build. Needs
# root and debootstrap.
set -euo pipefail
[ $# -ge 2 ] || { sed -n '2,25s/^# \{0,1\}//p' "$0" >&2; exit 2; }
project=$(cd "$(dirname "$0")/../.." && pwd)
folder=$(realpath -m "$1") way=$2 release=${BMS_DEBIAN:-bookworm}
shift 2
base=$folder/bare_$release deb=$folder/greybox-bms.deb
say() { echo "bare_debian: $*" >&2; }
[ "$(id -u)" = 0 ] || { say "not root, which a chroot needs"; exit 2; }
case $way in
  demo | test | package) ;;
  compiler) [ $# -gt 0 ] || { say "no compiler, expected names of packages: compiler g++-12 clang-19"; exit 2; } ;;
  install | find | subdirectory | cores | python) [ -f "$deb" ] || { say "no $deb, run package first"; exit 2; } ;;
  *)
    say "no such way '$way', expected demo, test, compiler, package, install, find, subdirectory, cores or python"
    exit 2 ;;
esac

make_base() {
  local url
  [ ! -x "$base/usr/bin/git" ] || return 0
  mkdir -p "$folder"
  url=$(sed -n 's/^URIs: *//p' /etc/apt/sources.list.d/debian.sources | head -1)
  debootstrap --variant=minbase --include=git,ca-certificates "$release" "$base" "$url" \
    >"$folder/debootstrap.log" 2>&1 || { tail -5 "$folder/debootstrap.log" >&2; exit 3; }
  rm -f "$base/etc/apt/sources.list"
  # shellcheck disable=SC1091
  sed "s/$(. /etc/os-release && echo "$VERSION_CODENAME")/$release/g" /etc/apt/sources.list.d/debian.sources \
    >"$base/etc/apt/sources.list.d/debian.sources"
  grep -ls Acquire /etc/apt/apt.conf.d/* | xargs -r -I{} cp -a {} "$base/etc/apt/apt.conf.d/"
  cp -a /usr/share/keyrings/. "$base/usr/share/keyrings/"
  cp -a /etc/ssl/certs "$base/etc/ssl/" 2>/dev/null || true
}

mounted=()
leave() {
  local root mount
  for root in "${mounted[@]}"; do
    for mount in sys dev/pts dev proc; do umount -l "$root/$mount" 2>/dev/null || true; done
    # never delete through a mount that would not come off
    if ! grep -q " $root/" /proc/mounts; then rm -rf --one-file-system "$root"; fi
  done
}
trap leave EXIT

open_root() {
  local mount
  mounted+=("$1")
  cp /etc/resolv.conf "$1/etc/resolv.conf" 2>/dev/null || true
  for mount in proc dev dev/pts sys; do mount --bind "/$mount" "$1/$mount"; done
}

# fresh NAME: a copy of the bare Debian with the project in /opt/project; sets root
fresh() {
  root=$folder/$1
  rm -rf --one-file-system "$root"
  cp -a "$base" "$root"
  git clone -q "$project" "$root/opt/project"
  cp "$deb" "$root/opt/" 2>/dev/null || true
  open_root "$root"
}

# step NAME: runs the commands of standard input in the root, in /opt/project
step() {
  local name=$1 TIMEFORMAT="$way: $1: %0R s, processor %0U s, system %0S s"
  # shellcheck disable=SC2046
  { time env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root TERM=dumb LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
    $(env | grep -iE '^(https?_proxy|no_proxy|SSL_CERT_FILE|CMAKE_BUILD_PARALLEL_LEVEL)=' || true) \
    chroot "$root" bash -c 'cd /opt/project && set -euo pipefail && . /dev/stdin' >"$folder/$way.log" 2>&1; } 2>&1 ||
    { tail -20 "$folder/$way.log" >&2; say "$way: $name failed, its output is $folder/$way.log"; exit 1; }
}

# packages NAME...: installs them in the root
packages() {
  step "packages" <<<"apt-get update && apt-get install -y --no-install-recommends $*"
}

# row COMMAND SECONDS RESULT: its row of the README's table
row() {
  "$project/tests/package/fresh_machine_row.py" "$project/README.md" "$1" "$release" \
    "$(git -C "$project" rev-parse --short=8 HEAD)" "$2" "$3"
}

way_demo() {
  fresh newcomer
  local start=$SECONDS
  step "./bms demo" <<<'./bms demo'
  row demo $((SECONDS - start)) "replay, verification on the emulated controller and diagnosis done"
}

way_test() {
  fresh newcomer
  local start=$SECONDS
  step "./bms test" <<<'./bms test'
  row test $((SECONDS - start)) "$(grep -o '[0-9]*% tests passed.*' "$folder/test.log")"
}

# what `./bms PURPOSE` needs, without its reasons
packages_of() {
  local list
  for list in "$@"; do sed -n "/^${list}_packages=\"/,/\"\$/s/^\([a-z0-9+.-]*\):.*/\1/p" "$project/bms"; done
}

way_compiler() {
  local name
  fresh compiler
  # shellcheck disable=SC2046
  packages $(packages_of host test) libclang-rt-dev "$@"
  for name in "$@"; do
    step "$name" <<<"CC=$(sed 's/^g++/gcc/' <<<"$name") CXX=$(sed 's/^clang/clang++/' <<<"$name") \
      cmake --preset host -DBMS_TESTS=ON -B /opt/$name && cmake --build /opt/$name --target bms host_only_tests -- -k 0"
    grep -o 'warning: .*\[-W[^]]*\]' "$folder/$way.log" | sed 's/.*\[\(-W[^]]*\)\]/\1/' | sort | uniq -c |
      sed "s/^/$name:/" || echo "$name: no warning"
  done
}

consumer='cp -r tests/package/consumer /opt/consumer && cp model/cells/table9.toml /opt/consumer/my_cell.toml'
# consume NAME OPTIONS: configures and builds the project of another
consume() {
  step "$1" <<<"$consumer; cmake -G Ninja -S /opt/consumer -B /opt/build_$1 -DGREYBOX_SOURCE=/opt/project \
    -DEXAMPLES=/opt/project/library/examples $2 && cmake --build /opt/build_$1"
}

way_package() {
  fresh building
  step "build, with the packages that it needs" <<<'./bms package'
  cp "$root"/opt/project/build/host/package/*.deb "$deb"
  fresh using
  step "installation" <<<'rm -rf /opt/project/*; apt-get update &&
    apt-get install -y --no-install-recommends /opt/*.deb'
  step "use" <<'COMMANDS'
cd /
bms --version
bms replay /usr/share/greybox/recordings/forklift_shift.csv --report /tmp/shift.html --json /tmp/shift.json
bms cell header table9 --out /tmp/cell.hpp && grep -q greybox/model.hpp /tmp/cell.hpp
test -s /tmp/shift.html && cd /usr/share/greybox && test -f can/greybox_bms.dbc && test -f cells/table9.toml
[ "$(stat -c %s /usr/bin/bms)" -lt 20000000 ]
COMMANDS
  packages man-db bash-completion zsh fish
  step "manual and completions" <<'COMMANDS'
# a bare Debian leaves man pages out; taken from the package itself
dpkg-deb -x /opt/*.deb /tmp/content
test -z "$(man --warnings -l /tmp/content/usr/share/man/man1/bms-replay.1 2>&1 >/dev/null)"
man -l /tmp/content/usr/share/man/man1/bms.1 | grep -q bms-replay
. /usr/share/bash-completion/completions/bms
COMP_WORDS=(bms replay --scalar '') COMP_CWORD=3
_bms && [ "${COMPREPLY[*]}" = "float fixed double" ]
fish -c 'complete -C "bms rep"' | grep -q '^replay'
fish -c 'complete -C "bms replay --scalar d"' | grep -q '^double'
zsh -n /usr/share/zsh/vendor-completions/_bms
zsh -c 'autoload -U compinit && compinit -u && [[ $_comps[bms] = _bms ]]'
COMMANDS
}

# Installs the same build into a prefix and hides sources and build: nothing may be taken from there.
way_install() {
  fresh installing
  step "build, with the packages that it needs" <<<'./bms cell show table9 &&
    cmake --build build/host --target manual'
  step "cmake --install" <<<'cmake --install build/host --prefix /opt/prefix && mv /opt/project /opt/hidden &&
    mkdir /opt/project'
  step "use" <<'COMMANDS'
cd /
export PATH=/opt/prefix/bin:$PATH
bms replay /opt/prefix/share/greybox/recordings/forklift_shift.csv --quiet --report /tmp/shift.html
[ "$(stat -c %s /opt/prefix/bin/bms)" -lt 20000000 ]
test -f /opt/prefix/share/man/man1/bms-replay.1
test -f /opt/prefix/share/bash-completion/completions/bms
test -f /opt/prefix/share/cmake/greybox/greyboxConfig.cmake
COMMANDS
}

way_find() {
  fresh finding
  packages /opt/greybox-bms.deb cmake ninja-build g++
  consume find -DGREYBOX_BY=find
  step "examples" <<<'cd /opt/build_find && test "$(./in_c)" = "$(./in_cpp)" && ./in_c | grep "60 s"'
}

way_subdirectory() {
  fresh adding
  packages /opt/greybox-bms.deb cmake ninja-build g++
  consume subdirectory -DGREYBOX_BY=subdirectory
  step "examples" <<<'cd /opt/build_subdirectory && test "$(./in_c)" = "$(./in_cpp)" && ./in_c | grep "60 s"'
  step "remove" <<<'rm -r /opt/consumer'
  consume fetch -DGREYBOX_BY=fetch
}

way_cores() {
  local toolchain="--toolchain /opt/project/cmake/toolchain-arm-none-eabi.cmake" m4f m0
  m4f="-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16" m0="-mcpu=cortex-m0 -mthumb"
  fresh crossing
  packages /opt/greybox-bms.deb cmake ninja-build gcc-arm-none-eabi libnewlib-arm-none-eabi \
    libstdc++-arm-none-eabi-newlib qemu-system-arm python3
  consume m4f "-DGREYBOX_BY=find -DCMAKE_FIND_ROOT_PATH=/usr -DCMAKE_C_FLAGS='$m4f' -DCMAKE_CXX_FLAGS='$m4f' $toolchain"
  step "remove" <<<'rm -r /opt/consumer'
  consume m0 "-DGREYBOX_BY=find -DCMAKE_FIND_ROOT_PATH=/usr -DBMS_FIXED=FIXED -DCMAKE_C_FLAGS='$m0' \
    -DCMAKE_CXX_FLAGS='$m0' $toolchain"
  step "firmware of an emulated board by the installed tool" <<<'rm -rf /opt/project/*; cd / && bms replay \
    /usr/share/greybox/recordings/forklift_shift.csv --target netduinoplus2 --verify'
}

way_python() {
  fresh python
  packages /opt/greybox-bms.deb pybind11-dev python3-dev python3-numpy python3-setuptools python3-wheel python3-pip \
    "$(packages_of host | tr '\n' ' ')"
  step "pip install" <<<'cd host_sim/python && pip install --no-build-isolation --no-index --break-system-packages .'
  step "tests of the module" <<<'cd / && BMS_TOOL=/usr/bin/bms BMS_SOURCE_DIR=/opt/project \
    python3 /opt/project/tests/host_sim/python/module_test.py'
}

make_base
"way_$way" "$@"
say "$way: done in $SECONDS s"
