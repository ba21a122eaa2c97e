#!/usr/bin/env bash
# A wall on a Slurm cluster:  sbatch --ntasks=5 launch/slurm.sh configs/two_by_two.yaml --seconds 60 --headless
# `wall check CONFIG` says how many tasks a configuration needs. --cpus-per-task gives each of them more cores.
#SBATCH --job-name=wall
#SBATCH --time=01:00:00
#SBATCH --cpus-per-task=2
set -euo pipefail
cd "${SLURM_SUBMIT_DIR:-$(dirname "${BASH_SOURCE[0]}")/..}"
export PATH="$PWD/.venv/bin:$PATH"

# mpirun inside the allocation, not srun: only mpirun lets the other ranks continue when one dies (ULFM).
# The configuration must listen where other nodes can reach it: transport: {bind: 0.0.0.0}
exec mpirun --with-ft ulfm --map-by "slot:PE=${SLURM_CPUS_PER_TASK:-1}" -n "${SLURM_NTASKS:?submit this with sbatch --ntasks=N}" \
    wall run "$@"
