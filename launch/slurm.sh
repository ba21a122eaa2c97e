#!/usr/bin/env bash
# A wall on a Slurm cluster:  sbatch --ntasks=5 launch/slurm.sh configs/demo.yaml --seconds 60 --headless
# `wall check CONFIG` says how many tasks a configuration needs. --cpus-per-task gives each of them more cores.
# Relative paths start where sbatch is called. MPIRUN_OPTIONS are handed to mpirun.
#SBATCH --job-name=wall
#SBATCH --time=01:00:00
#SBATCH --cpus-per-task=2
set -euo pipefail
# Slurm runs a copy of this script from a folder of its own, and knows where the script came from
script=${BASH_SOURCE[0]}
if [ -n "${SLURM_JOB_ID:-}" ] && command -v scontrol >/dev/null; then
    known=$(scontrol show job "$SLURM_JOB_ID" | sed -n 's/^ *Command=\([^ ]*\).*/\1/p')
    [ -e "$known" ] && script=$known
fi
clone=$(cd "$(dirname "$script")/.." && pwd)
[ -x "$clone/.venv/bin/wall" ] || { echo "$clone/.venv has no wall: source launch/setup.sh; setup local" >&2; exit 2; }
export PATH="$clone/.venv/bin:$PATH"

# mpirun inside the allocation, not srun: only mpirun lets the other ranks continue when one dies (ULFM).
# The configuration must listen where other nodes can reach it: transport: {bind: 0.0.0.0}
# Slurm's CPUs are hardware threads where cores have several: --use-hwthread-cpus counts as it does.
# shellcheck disable=SC2086  # several options
exec mpirun --with-ft ulfm --use-hwthread-cpus ${MPIRUN_OPTIONS:-} --map-by "slot:PE=${SLURM_CPUS_PER_TASK:-1}" -n "${SLURM_NTASKS:?submit this with sbatch --ntasks=N}" \
    wall run "$@"
