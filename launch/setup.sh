# Sourced, by the scripts in this folder or in a shell: makes .venv/ in the clone, installs the packages that
# pyproject.toml names, and puts .venv/bin first in PATH.
# setup EXTRAS...   (skipped if neither pyproject.toml nor constraints.txt changed since the last time)

setup() {
    local here; here=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
    local extras; extras=$(IFS=,; echo "$*")
    local python=${PYTHON:-python3}
    local stamp=$here/.venv/installed-$extras
    local wanted; wanted=$(cat "$here/pyproject.toml" "$here/launch/constraints.txt" | cksum)
    if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$wanted" ]; then
        export PATH="$here/.venv/bin:$PATH"
        return
    fi
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || {
        echo "wall needs Python 3.11 or newer; '$python' is $("$python" --version 2>&1 || echo missing)." >&2
        echo "Name another one: export PYTHON=/path/to/python3.12" >&2
        return 1
    }
    echo "setting up .venv (once; up to a minute)"
    if [ "$("$here/.venv/bin/python" -VV 2>/dev/null)" != "$("$python" -VV)" ] || [ ! -x "$here/.venv/bin/pip" ]; then
        rm -f "$here"/.venv/installed-*
        "$python" -m venv "$here/.venv" || {
            echo "could not make a virtual environment; on Debian: apt install python3-venv" >&2
            return 1
        }
    fi
    export PATH="$here/.venv/bin:$PATH"
    _install_wall "$here" "$extras" || { echo "installing failed; the lines above say why" >&2; return 1; }
    echo "$wanted" > "$stamp"
}

# uv installs in a quarter of pip's time. It does not read pip's settings (mirrors, proxies): where it fails, pip tries.
_install_wall() {
    local packages=(-c "$1/launch/constraints.txt" -e "$1[$2]")
    local pip=(python -m pip install --disable-pip-version-check --no-input)
    if "${pip[@]}" -q uv >/dev/null 2>&1 &&
        VIRTUAL_ENV=$1/.venv uv pip install -q --compile-bytecode "${packages[@]}" 2>/dev/null; then
        return
    fi
    "${pip[@]}" "${packages[@]}" 2>&1 | _show_progress
    return "${PIPESTATUS[0]}"
}

# On a terminal one line that is overwritten, otherwise one line for each package; then what else it said, if it failed.
_show_progress() {
    local line done="" said=()
    while IFS= read -r line; do
        case "$line" in
            Collecting*|Downloading*|Installing*|Building*|"  Preparing"*)
                if [ -t 1 ]; then printf '\r\033[K  %.70s' "$line"; else printf '  %.100s\n' "$line"; fi ;;
            "Successfully installed"*)
                if [ -t 1 ]; then printf '\r\033[K'; fi
                echo "  installed $(wc -w <<<"$line") packages"
                done=1 ;;
            *rror*) said+=("$line") ;;
            "  "*|Requirement*|Obtaining*|"") ;;
            *) said+=("$line") ;;
        esac
    done
    [ -z "$done" ] || return 0
    if [ -t 1 ]; then printf '\r\033[K'; fi
    printf '%.300s\n' "${said[@]}" | tail -n 8 >&2
    case "${said[*]}" in *"onnection"*|*"name resolution"*|*"timed out"*)
        echo "the package index cannot be reached; without a network: docs/guide/cluster.md, Before the first run" >&2 ;;
    esac
}
