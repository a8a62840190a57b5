"""Trace the photographs of a folder, and fit loads and beam to all of them jointly."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from solver.instrument.errors import InputError
from solver.instrument.estimate import Outcome
from solver.photographs.answer import (
    PhotoAnswer,
    Value,
    misfit_answer,
    photo_answer,
    shared_values,
)
from solver.photographs.conflicts import worst_conflict
from solver.photographs.fit import PhotosFit, Shown, Unfitted, fit_photos
from solver.photographs.notes import notes_of
from solver.photographs.photo_set import Photograph, PhotoSet
from solver.tracing.traced import photograph, traced_beam

_UNFITTED: Final = PhotoAnswer(
    Outcome.NOT_CONVERGED,
    "With this photograph the joint fit does not converge: it is left out. Check clamp_px and "
    "tip_px, and whether the points are on the beam.",
)

Progress = Callable[[Iterable[Photograph]], Iterable[Photograph]]


@dataclass(frozen=True)
class PhotosAnswer:
    """Answers for all photographs, what they share, and sentences on what cannot be known.

    `shown` is None for a photograph in which no beam was found; `fit` is the joint fit of the
    photographs with the indices `fitted`, None if there is none.
    """

    photos: PhotoSet
    answers: tuple[PhotoAnswer, ...]
    shared: dict[str, Value]
    notes: tuple[str, ...]
    shown: tuple[Shown | None, ...]
    fitted: tuple[int, ...]
    fit: PhotosFit | None


def solve_photos(photos: PhotoSet, progress: Progress = iter) -> PhotosAnswer:
    """Trace the beam in every photograph, and fit all of them jointly.

    A photograph without a beam has an outcome that says so. Raises InputError if a file is missing
    or is not an image, or if sizes differ without a focal length and principal points.
    """
    shown: list[Shown | None] = []
    messages: dict[int, str] = {}
    expected: tuple[int, int] | None = None
    for i, photo in enumerate(progress(photos.photographs)):
        image = photograph(photo.path, photos.channel)
        size = (image.shape[1], image.shape[0])
        try:
            shown.append(Shown(traced_beam(image, photo.clamp, photo.tip), size))
        except InputError as error:
            shown.append(None)
            messages[i] = str(error)
        expected = expected or size
        cropped = photo.principal_point is not None and photos.focal is not None
        if sorted(size) != sorted(expected) and not cropped:
            first = photos.photographs[0].path.name
            raise InputError(
                f"{photo.path}: has {size[0]} x {size[1]} px, allowed is the size of {first}, "
                f"{expected[0]} x {expected[1]} px, or the same size upright, or a crop with "
                "principal_point_px and camera.focal_length_px"
            )
    return answer_photos(photos, shown, messages)


def answer_photos(
    photos: PhotoSet, shown: Sequence[Shown | None], messages: Mapping[int, str]
) -> PhotosAnswer:
    """Answer for traced photographs; `messages` say why there is no beam in some of them.

    A photograph that prevents convergence, that no beam with a single load fits, or of which a
    stated value is contradicted, is left out of the joint fit, the worst first. If a value that all
    share is contradicted, or half of the stated loads, none has values.
    """
    answers = {i: PhotoAnswer(Outcome.INVALID, text) for i, text in messages.items()}
    fitted = [i for i in range(len(shown)) if i not in messages]
    loads = [photo.load for photo in photos.photographs if photo.load]
    stated, contradicted = sum(bool(load.force or load.place) for load in loads), 0
    while fitted:
        part = replace(photos, photographs=tuple(photos.photographs[i] for i in fitted))
        fit = fit_photos(part, [one for i in fitted if (one := shown[i]) is not None])
        if isinstance(fit, Unfitted):
            answers[fitted.pop(fit.photo)] = _UNFITTED
            continue
        misfits = [one.misfit if not one.fits else 0.0 for one in fit.fits]
        if any(misfits):
            worst = misfits.index(max(misfits))
            answers[fitted.pop(worst)] = misfit_answer(fit, worst)
            continue
        conflict = worst_conflict(fit, part)
        if conflict:
            refused = fitted if conflict.photo is None else [fitted[conflict.photo]]
            contradicted += conflict.of_load
            # One of two stated loads is wrong, or what all share: which, is unknown.
            if conflict.of_load and 2 * contradicted >= stated:
                refused = fitted
            answers |= dict.fromkeys(refused, PhotoAnswer(Outcome.INVALID, conflict.sentence))
            fitted = [i for i in fitted if i not in answers]
            continue
        own = [photo_answer(fit, part, i) for i in range(len(fitted))]
        hidden = [i for i, one in enumerate(own) if _hides_rigidity(part, i, one)]
        if hidden:
            answers[fitted.pop(hidden[0])] = own[hidden[0]]
            continue
        answers |= dict(zip(fitted, own, strict=True))
        return PhotosAnswer(
            photos=photos,
            answers=tuple(answers[i] for i in range(len(shown))),
            shared=shared_values(fit, part),
            notes=tuple(notes_of(fit, part, own)),
            shown=tuple(shown),
            fitted=tuple(fitted),
            fit=fit,
        )
    return PhotosAnswer(
        photos=photos,
        answers=tuple(answers[i] for i in range(len(shown))),
        shared={},
        notes=(),
        shown=tuple(shown),
        fitted=(),
        fit=None,
    )


def _hides_rigidity(photos: PhotoSet, photo: int, answer: PhotoAnswer) -> bool:
    """Return whether EI would follow from a load that the photograph does not show."""
    load = photos.photographs[photo].load
    known = load is not None and load.force is not None and photos.rigidity is None
    return known and not answer.outcome.has_values
