#!/usr/bin/env bash
# mbedtls.sh FOLDER: downloads the source package mbedtls with apt, from the mirrors that this machine uses, and unpacks
# it into FOLDER. Changes nothing of the machine's own package lists and needs no root. About 14 MB.
set -euo pipefail
folder=$1
work=$(mktemp -d "$(dirname "$folder")/mbedtls.XXXXXX")
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir -p lists/partial cache/archives/partial
keyring=''
for file in /usr/share/keyrings/debian-archive-keyring.gpg /usr/share/keyrings/ubuntu-archive-keyring.gpg; do
  if [ -r "$file" ]; then keyring="[signed-by=$file] "; break; fi
done
apt-get indextargets --format '$(ORIGIN) $(SITE) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' |
  sed -n -E "s#^(Debian|Ubuntu) #deb-src $keyring#p" | sort -u >sources.list
apt=(apt-get -qq -o Dir::Etc::SourceList="$work/sources.list" -o Dir::Etc::SourceParts=/dev/null
  -o Dir::State::Lists="$work/lists" -o Dir::Cache="$work/cache" -o APT::Sandbox::User=)
"${apt[@]}" update
"${apt[@]}" source --download-only mbedtls
mkdir unpacked
tar -xf mbedtls_*.orig.tar.* -C unpacked --strip-components=1
grep -q 'MBEDTLS_VERSION_STRING  *"2\.28\.' unpacked/include/mbedtls/version.h || {
  echo "mbedtls.sh: expected version 2.28, the package has another" >&2; exit 1; }
rm -rf "$folder"
mv unpacked "$folder"
