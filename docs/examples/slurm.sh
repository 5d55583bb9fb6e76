#!/bin/bash
#SBATCH --array=0-99 --cpus-per-task=4 --mem=2G
# sbatch slurm.sh AUDIO OUT; afterwards: corsmal-feat merge OUT/*.npz --out feats.npz
# A preempted task continues where it stopped; --array=3,7 repeats two tasks.
set -euo pipefail
TASKS=${TASKS:-100} # number of tasks in the array
mkdir -p "$2"
# Exit code 1: finished, but some recordings have no features. Their rows say why.
corsmal-feat extract "$1" --preset mfcc-zcr \
    --shard "$SLURM_ARRAY_TASK_ID/$TASKS" \
    --jobs "$SLURM_CPUS_PER_TASK" \
    --resume --out "$2/$SLURM_ARRAY_TASK_ID.npz" || [ $? -eq 1 ]
