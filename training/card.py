"""The model card, made from a run: data, numbers, limits, hash."""

from training.labels import PRIMITIVES
from training.outcome import Judged, Run
from training.people import WIDE, Share


def _row(judged: Judged) -> str:
    whole = judged.whole
    early = " | ".join(f"{s.f1:.3f}" for _, s in judged.early)
    return (
        f"| {judged.name} | {whole.count} of {whole.operators} | {whole.f1:.3f}"
        f" | {whole.interval[0]:.3f} to {whole.interval[1]:.3f} | {early}"
        f" | {judged.calibration:.3f} | {judged.auroc:.3f} |"
    )


def _confusion(judged: Judged) -> str:
    head = f"| was \\ said | {' | '.join(PRIMITIVES)} |\n|{'---|' * (len(PRIMITIVES) + 1)}\n"
    rows = (
        f"| {label} | {' | '.join(str(n) for n in row)} |\n"
        for label, row in zip(PRIMITIVES, judged.whole.confusion.tolist(), strict=True)
    )
    return head + "".join(rows)


def _share(name: str, share: Share, size: int) -> str:
    return f"| {name} | {share.wide_people} | {share.thesis_people} | {size} |"


def card_of(run: Run) -> str:
    """The card as Markdown."""
    preset, first = run.preset, run.judged[0]
    early = " | ".join(f"F1 {after:g} s" for after, _ in first.early)
    wide = next(judged for judged in run.judged if judged.name == WIDE.name)
    families = "".join(f"| {name} | {f1:.3f} |\n" for name, f1 in wide.families.items())
    shares = (preset.training, preset.validation, preset.test)
    sets = "\n".join(
        _share(name, share, run.sizes[name]) for name, share in zip(run.sizes, shares, strict=True)
    )
    epochs = len(run.fitted.history)
    return f"""# intent.onnx

Which primitive do the sticks draw: {", ".join(PRIMITIVES)}? Or none of them?
Written by `autocomplete train --preset {run.preset_name} --seed {run.seed}`; its figures and the
training's history for programs are in intent.json, how it works is in docs/model.md.

- SHA-256: `{run.sha256}`
- Contract: `intent-sticks/2`, in services/classifier/model.py. In: sticks as the pad sends them, at
  50 Hz. Out: probabilities of the {len(PRIMITIVES)}, and how likely it is that one is meant at all.
- An answer counts from a confidence of {run.fitted.confidence_min:.3f} on: above it 95 % of the
  answers to the validation people were right.
- ONNX against torch on test windows: largest difference {run.parity:.1e}.

## Data

Sticks of simulated people only (training/generator): the wide population of many families, and the
population on which the thesis' support vector machine scores as in the thesis. Nobody is in two
sets. Classes are as frequent as in the thesis, and a fifth of all is none of them.

| set | people, wide | people, thesis | performances |
|---|---|---|---|
{sets}

{epochs} epochs of random windows.

## Figures on people held out

F1 is weighted by class; the interval is 95 % over people (bootstrap). "F1 2 s" is asked two seconds
after the motion began. ECE is the expected calibration error over all these moments, in 15 bins.
AUROC tells primitives from none, at the end. The comparison with other classifiers, over five seeds
and with whole families held out, is in docs/evaluation.md.

| population | primitives of people | F1 | 95 % interval | {early} | ECE | AUROC |
|{"---|" * (6 + len(first.early))}
{chr(10).join(_row(judged) for judged in run.judged)}

The {first.name} population:

{_confusion(first)}
The {wide.name} population:

{_confusion(wide)}
| family | F1 |
|---|---|
{families}
## Limits

- No person's sticks are in the data. How well it does on people is not known;
  `autocomplete train --finetune` adapts it to one.
- The people held out here are of the same families as those it learned from.
- Windows over 400 samples keep the newest 400.
- A turn of 0.2 rad/s is a line to it until 60 to 85 degrees are flown.
"""
