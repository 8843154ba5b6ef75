#!/bin/sh
# Makes the certificates of a site: an authority, then one certificate for each router, server,
# robot and operator. Needs openssl (1.1.1 or newer) and a POSIX shell; uses no network.
set -eu

days=365
ca_days=3650
out=certificates

usage() {
    cat <<'HELP'
Usage: make-certificates.sh [OPTIONS] authority|renew-authority|finish-authority
       make-certificates.sh [OPTIONS] ROLE NAME [HOST...]

Makes what mutual TLS needs, as PEM files in DIR (default: certificates):

  authority               ca.pem, which everybody gets, and ca.key, which stays here
  renew-authority         a new authority: old files move to DIR/old, and ca.pem holds both, the new one first
  finish-authority        ca.pem holds the new authority alone: once routers have it, old certificates are refused
  router NAME HOST...     ROLE-NAME.pem and ROLE-NAME.key for a Zenoh router that is reached as HOST
  server NAME [HOST...]   … for a map-server; with HOST when robots connect to it directly
  explorer NAME           … for a robot that may write maps
  client NAME             … for a robot that only uses them
  operator NAME           … for a person's tools: edits maps and gives admin orders

NAME is the robot's name (--robot), 1 to 55 of a-z A-Z 0-9 _ -; the certificate's common name is ROLE:NAME, for example
explorer:ana. A HOST is an IP address or a DNS name.

  --out DIR                where the files are
  --days N                 how long the certificate is valid, in days (default: 365; the authority: 3650)
  --passphrase-file FILE   the first line of FILE is the passphrase of the authority's key
  --no-passphrase          the authority's key is stored as it is
  --help                   this text

Who has ca.key makes certificates for every role, so it is stored encrypted with a passphrase: that of --passphrase-file, or
of the environment variable FHT_CA_PASSPHRASE, or one that is asked for on the terminal. Without any of them it is stored as
it is. The keys of routers, servers and robots are not encrypted, since these start without a person.

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

passphrase=${FHT_CA_PASSPHRASE-}
asks=yes
while [ $# -gt 0 ]; do
    case $1 in
        --passphrase-file)
            [ $# -ge 2 ] || fail "$1 needs a value"
            [ -r "$2" ] || fail "$2, which has the passphrase, cannot be read"
            passphrase=
            IFS= read -r passphrase <"$2" || [ -n "$passphrase" ] || fail "$2, which has the passphrase, is empty"
            [ -n "$passphrase" ] || fail "the first line of $2, which has the passphrase, is empty"
            shift 2
            ;;
        --no-passphrase)
            passphrase= asks=
            shift
            ;;
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
    '' | 0* | *[!0-9]* | ??????*) fail "--days $days is not a number of days from 1 to 99999" ;;
esac
command -v openssl >/dev/null 2>&1 || fail "openssl is not installed"

role=$1
shift
for argument in "$@"; do
    case $argument in
        -*) fail "$argument comes too late: options stand before $role" ;;
    esac
done
# Keys and whatever else is made here belong to who made them.
umask 077
case $out in -*) out=./$out ;; esac
mkdir -p "$out"
work= restores= renewed=
trap '[ -z "$restores" ] || stty "$restores"; rm -rf "$work" ${renewed:+"$renewed"}' EXIT
trap 'exit 1' HUP INT TERM
work=$(mktemp -d)

# Runs openssl; what it says is shown only when it fails.
quietly() {
    "$@" >"$work/said" 2>&1 || { cat "$work/said" >&2; fail "openssl failed"; }
}

# Asks on the terminal for the passphrase, unseen.
ask() {
    printf '%s' "$1" >&2
    restores=$(stty -g)
    stty -echo
    IFS= read -r answer || answer=
    stty "$restores"
    restores=
    echo >&2
}

# Openssl reads the passphrase here: arguments are seen by everybody on the machine.
lend_passphrase() {
    FHT_CA_PASSPHRASE=$passphrase
    export FHT_CA_PASSPHRASE
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

if [ "$role" = renew-authority ]; then
    [ $# -eq 0 ] || fail "renew-authority takes no further arguments"
    [ -r "$out/ca.key" ] && [ -r "$out/ca.pem" ] || fail "$out has no authority; run: make-certificates.sh --out $out authority"
    [ ! -e "$out/old" ] || fail "$out/old exists: finish-authority, and move it away first"
    if grep -q 'BEGIN ENCRYPTED' "$out/ca.key" && [ -z "$passphrase" ] && [ -n "$asks" ] && [ ! -t 0 ]; then
        fail "$out/ca.key is encrypted: give the new one a passphrase, or --no-passphrase"
    fi
    # The new key is stored as was asked for.
    plain=
    [ -n "$asks" ] || plain=--no-passphrase
    # The old authority stays where it is until the new one takes its place: made beside it, it only
    # has to be renamed.
    renewed=$(mktemp -d "$out/renewed.XXXXXX")
    FHT_CA_PASSPHRASE=$passphrase sh "$0" --out "$renewed" --days "$ca_days" $plain authority >"$work/made"
    # Whoever reads the first only, reads the one that signs from now on.
    cat "$renewed/ca.pem" "$out/ca.pem" >"$renewed/both.pem"
    chmod 644 "$renewed/both.pem"
    trap '' HUP INT TERM
    mkdir "$out/old"
    cp -p "$out"/*.pem "$out"/*.key "$out/old/"
    mv "$renewed/ca.key" "$out/ca.key"
    mv "$renewed/both.pem" "$out/ca.pem"
    for file in "$out"/*.pem "$out"/*.key; do
        case $file in
            "$out"/ca.pem | "$out"/ca.key) ;;
            *) rm "$file" ;;
        esac
    done
    echo "$out/ca.pem, $out/ca.key"
    echo "$out/ca.pem holds both authorities; make all certificates anew, but those that are revoked"
    exit 0
fi
if [ "$role" = finish-authority ]; then
    [ $# -eq 0 ] || fail "finish-authority takes no further arguments"
    [ -r "$out/old/ca.pem" ] || fail "no authority is being renewed in $out: there is no $out/old/ca.pem"
    quietly openssl x509 -in "$out/ca.pem" -out "$work/certificate"
    mv "$work/certificate" "$out/ca.pem"
    chmod 644 "$out/ca.pem"
    echo "$out/ca.pem holds the new authority alone"
    exit 0
fi
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
    if [ -z "$passphrase" ] && [ -n "$asks" ] && [ -t 0 ]; then
        ask "Passphrase for the authority's key (empty: none): "
        passphrase=$answer
        [ -z "$passphrase" ] || ask "Once more: "
        [ "$passphrase" = "$answer" ] || fail "the two are not the same"
    fi
    quietly openssl ecparam -name prime256v1 -genkey -noout -out "$work/plain"
    if [ -n "$passphrase" ]; then
        [ ${#passphrase} -ge 8 ] || fail "the passphrase is shorter than 8 characters"
        lend_passphrase
        quietly openssl pkcs8 -topk8 -v2 aes-256-cbc -iter 600000 -passout env:FHT_CA_PASSPHRASE -in "$work/plain" -out "$work/key"
    else
        quietly openssl pkcs8 -topk8 -nocrypt -in "$work/plain" -out "$work/key"
        [ -z "$asks" ] ||
            echo "make-certificates.sh: ca.key has no passphrase: whoever reads it makes certificates for every role" >&2
    fi
    quietly openssl req -new -x509 -sha256 -key "$work/plain" -days "$ca_days" -config "$work/config" -out "$work/certificate"
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

if grep -q 'BEGIN ENCRYPTED' "$out/ca.key"; then
    if [ -z "$passphrase" ] && [ -t 0 ]; then
        ask "Passphrase of the authority's key: "
        passphrase=$answer
    fi
    [ -n "$passphrase" ] || fail "$out/ca.key is encrypted; its passphrase is that of --passphrase-file or of FHT_CA_PASSPHRASE"
    lend_passphrase
    openssl pkey -in "$out/ca.key" -passin env:FHT_CA_PASSPHRASE -noout 2>/dev/null || fail "the passphrase of $out/ca.key is another"
else
    passphrase=
fi

# Of a DNS name, and of an IPv4 address.
label='[a-zA-Z0-9_]([a-zA-Z0-9_-]{0,61}[a-zA-Z0-9_])?'
byte='(25[0-5]|2[0-4][0-9]|1?[0-9]?[0-9])'
# Robots only ever connect, so their certificates are no good for listening.
purpose=clientAuth
hosts=
case $role in
    router | server)
        [ "$role" = server ] || [ $# -ge 1 ] || fail "a router needs at least one HOST, the name or address that others connect to"
        for host in "$@"; do
            case $host in
                '' | *[!a-zA-Z0-9.:_-]*) fail "'$host' is neither a DNS name nor an IP address" ;;
                *:*) kind=IP of='[0-9a-fA-F]*(:[0-9a-fA-F.]*){2,}' ;;
                *[!0-9.]*) kind=DNS of="($label[.])*$label" ;;
                *) kind=IP of="($byte[.]){3}$byte" ;;
            esac
            printf '%s' "$host" | grep -Exq "$of" || fail "'$host' is neither a DNS name nor an IP address"
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
# Of what has colons, openssl alone knows whether it is an address.
case $hosts in
    *IP:*:*)
        openssl req -new -x509 -key "$work/key" -config "$work/config" -extensions leaf -out "$work/probe" 2>/dev/null ||
            fail "these are not all DNS names and IP addresses: $*"
        ;;
esac
quietly openssl req -new -sha256 -key "$work/key" -config "$work/config" -out "$work/request"
# A serial number of its own, from the system's randomness: two people may issue at one time.
quietly openssl x509 -req -sha256 -in "$work/request" -CA "$out/ca.pem" -CAkey "$out/ca.key" \
    ${passphrase:+-passin env:FHT_CA_PASSPHRASE} -set_serial "0x01$(openssl rand -hex 15)" -days "$days" -extfile "$work/config" -extensions leaf -out "$work/certificate"
publish "$role-$name"
