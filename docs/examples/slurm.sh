#!/bin/bash
#SBATCH --array=0-99 --cpus-per-task=4 --mem=2G
# sbatch slurm.sh AUDIO OUT; afterwards: corsmal-feat merge OUT/*.npz --out feats.npz
# A task that was preempted and starts again goes on where it was; --array=3,7 repeats two of them.
set -euo pipefail
TASKS=${TASKS:-100} # of the whole array
mkdir -p "$2"
# Exit code 1: finished, some recordings without features. Their rows say why.
corsmal-feat extract "$1" --preset mfcc-zcr \
    --shard "$SLURM_ARRAY_TASK_ID/$TASKS" \
    --jobs "$SLURM_CPUS_PER_TASK" \
    --resume --out "$2/$SLURM_ARRAY_TASK_ID.npz" || [ $? -eq 1 ]
