#!/usr/bin/env bash
# A wall on several hosts by ssh, without a batch system:
#   launch/mpirun-hosts.sh hosts.txt 5 configs/demo.yaml --seconds 60
# hosts.txt has one line for each host, such as: node1 slots=3. The clone and its .venv must be at the same path on all
# hosts. Relative paths start where this is called; that folder must be there on all hosts too. MPIRUN_OPTIONS are
# handed to mpirun: MPIRUN_OPTIONS="--oversubscribe --allow-run-as-root" launch/mpirun-hosts.sh ...
set -euo pipefail
hosts=${1:?usage: $0 HOSTFILE RANKS CONFIG [options of wall run]}; ranks=${2:?how many ranks}; shift 2
clone=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
export PATH="$clone/.venv/bin:$PATH"
# shellcheck disable=SC2086  # several options
exec mpirun --with-ft ulfm ${MPIRUN_OPTIONS:-} --hostfile "$hosts" --map-by slot -x PATH -n "$ranks" wall run "$@"
