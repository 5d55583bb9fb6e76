#!/bin/bash
#SBATCH --array=0-99 --cpus-per-task=4 --mem=2G
# sbatch slurm.sh AUDIO OUT; afterwards: corsmal-feat merge OUT/*.npz --out feats.npz
# A task that was preempted and starts again goes on where it was.
set -euo pipefail
mkdir -p "$2"
corsmal-feat extract "$1" --preset mfcc-zcr \
    --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" \
    --jobs "$SLURM_CPUS_PER_TASK" \
    --resume --out "$2/$SLURM_ARRAY_TASK_ID.npz"
