#!/bin/sh
# Makes the certificates of a site: an authority, then one certificate for each router, server, robot and operator.
# Needs openssl (1.1.1 or newer) and a POSIX shell; uses no network.
set -eu

days=365
ca_days=3650
out=certificates

usage() {
    cat <<'HELP'
Usage: make-certificates.sh [--out DIR] [--days N] authority
       make-certificates.sh [--out DIR] [--days N] ROLE NAME [HOST...]

Makes what mutual TLS needs, as PEM files in DIR (default: certificates):

  authority               ca.pem, which everybody gets, and ca.key, which stays here
  router NAME HOST...     ROLE-NAME.pem and ROLE-NAME.key for a Zenoh router that is reached as HOST
  server NAME [HOST...]   … for a map-server; with HOST when robots connect to it directly
  explorer NAME           … for a robot that may write maps
  client NAME             … for a robot that only uses them
  operator NAME           … for a person's tools: edits maps and gives admin orders

NAME is the robot's name (--robot), 1 to 55 of a-z A-Z 0-9 _ -; the certificate's common name is ROLE:NAME, for example
explorer:ana. A HOST is an IP address or a DNS name.

  --out DIR    where the files are
  --days N     how long the certificate is valid, in days (default: 365; the authority: 3650)
  --help       this text

Keys are elliptic (P-256), private ones are readable by their owner only, and nothing is ever overwritten: to renew a
certificate, move the old files away first.

Example:
  make-certificates.sh authority
  make-certificates.sh router hall hall.example 192.168.1.10
  make-certificates.sh server maps
  make-certificates.sh --days 90 explorer ana
HELP
}

fail() {
    echo "make-certificates.sh: $1" >&2
    exit 1
}

while [ $# -gt 0 ]; do
    case $1 in
        --out | --days)
            [ $# -ge 2 ] || fail "$1 needs a value"
            if [ "$1" = --out ]; then out=$2; else days=$2 ca_days=$2; fi
            shift 2
            ;;
        -h | --help) usage; exit 0 ;;
        -*) fail "unknown option $1; see --help" ;;
        *) break ;;
    esac
done
[ $# -ge 1 ] || { usage >&2; exit 1; }
case $days in
    '' | *[!0-9]* | ??????*) fail "--days $days is not a number of days from 1 to 99999" ;;
esac
[ "$days" -gt 0 ] || fail "--days $days is not a number of days from 1 to 99999"
command -v openssl >/dev/null 2>&1 || fail "openssl is not installed"

role=$1
shift
# Keys and whatever else is made here belong to who made them.
umask 077
mkdir -p "$out"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM

# Runs openssl; what it says is shown only when it fails.
quietly() {
    "$@" >"$work/said" 2>&1 || { cat "$work/said" >&2; fail "openssl failed"; }
}

# Moves a finished pair into place: key first, so that a certificate never lies there without one.
publish() {
    for file in "$out/$1.key" "$out/$1.pem"; do
        [ ! -e "$file" ] || fail "$file exists; move it away first"
    done
    mv "$work/key" "$out/$1.key"
    chmod 600 "$out/$1.key"
    mv "$work/certificate" "$out/$1.pem"
    chmod 644 "$out/$1.pem"
    echo "$out/$1.pem, $out/$1.key"
}

if [ "$role" = authority ]; then
    [ $# -eq 0 ] || fail "authority takes no further arguments"
    [ ! -e "$out/ca.key" ] && [ ! -e "$out/ca.pem" ] || fail "$out has an authority; move ca.key and ca.pem away first"
    cat >"$work/config" <<'CONFIG'
[req]
distinguished_name = name
prompt = no
x509_extensions = authority
[name]
CN = FHT-Map authority
[authority]
basicConstraints = critical, CA:TRUE, pathlen:0
keyUsage = critical, keyCertSign, cRLSign
subjectKeyIdentifier = hash
CONFIG
    quietly openssl ecparam -name prime256v1 -genkey -noout -out "$work/plain"
    quietly openssl pkcs8 -topk8 -nocrypt -in "$work/plain" -out "$work/key"
    quietly openssl req -new -x509 -sha256 -key "$work/key" -days "$ca_days" -config "$work/config" -out "$work/certificate"
    publish ca
    exit 0
fi

case $role in
    router | server | explorer | client | operator) ;;
    *) fail "unknown role $role: authority, router, server, explorer, client or operator" ;;
esac
[ $# -ge 1 ] || fail "$role needs a NAME"
name=$1
shift
case $name in
    '' | *[!a-zA-Z0-9_-]*) fail "the name '$name' is not made of a-z A-Z 0-9 _ -" ;;
esac
# X.509 allows 64 characters for role and name.
[ ${#name} -le 55 ] || fail "the name '$name' is longer than 55 characters"
[ -r "$out/ca.key" ] && [ -r "$out/ca.pem" ] || fail "$out has no authority; run: make-certificates.sh --out $out authority"

# Robots only ever connect, so their certificates are no good for listening.
purpose=clientAuth
hosts=
case $role in
    router | server)
        [ "$role" = server ] || [ $# -ge 1 ] || fail "a router needs at least one HOST, the name or address that others connect to"
        for host in "$@"; do
            case $host in
                '' | *[!a-zA-Z0-9.:_-]*) fail "'$host' is neither a DNS name nor an IP address" ;;
                *:* ) kind=IP ;;
                *[!0-9.]*) kind=DNS ;;
                *) kind=IP ;;
            esac
            hosts="$hosts${hosts:+,}$kind:$host"
            purpose="clientAuth, serverAuth"
        done
        ;;
    *) [ $# -eq 0 ] || fail "a certificate for $role names no hosts" ;;
esac

cat >"$work/config" <<CONFIG
[req]
distinguished_name = name
prompt = no
[name]
CN = $role:$name
[leaf]
basicConstraints = critical, CA:FALSE
keyUsage = critical, digitalSignature
extendedKeyUsage = $purpose
subjectKeyIdentifier = hash
authorityKeyIdentifier = keyid
${hosts:+subjectAltName = $hosts}
CONFIG
for file in "$out/$role-$name.key" "$out/$role-$name.pem"; do
    [ ! -e "$file" ] || fail "$file exists; move it away first"
done
# The same name is the same author of increments, whatever the role.
case $role in
    explorer | client | operator)
        for other in explorer client operator; do
            [ ! -e "$out/$other-$name.pem" ] || fail "$name is $other already ($out/$other-$name.pem); a name has one role"
        done
        ;;
esac
quietly openssl ecparam -name prime256v1 -genkey -noout -out "$work/plain"
quietly openssl pkcs8 -topk8 -nocrypt -in "$work/plain" -out "$work/key"
quietly openssl req -new -sha256 -key "$work/key" -config "$work/config" -out "$work/request"
# A serial number of its own, from the system's randomness: two people may issue at one time.
quietly openssl x509 -req -sha256 -in "$work/request" -CA "$out/ca.pem" -CAkey "$out/ca.key" \
    -set_serial "0x01$(openssl rand -hex 15)" -days "$days" -extfile "$work/config" -extensions leaf -out "$work/certificate"
publish "$role-$name"
