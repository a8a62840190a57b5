"""Trace the photographs of a folder, and fit loads and beam to all of them jointly."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from solver.instrument.errors import InputError
from solver.instrument.estimate import Outcome
from solver.photographs.answer import PhotoAnswer, Value, photo_answer, shared_values
from solver.photographs.fit import PhotosFit, Shown, fit_photos
from solver.photographs.notes import contradicted_statement, notes_of
from solver.photographs.photo_set import Photograph, PhotoSet
from solver.tracing.traced import photograph, traced_beam

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
    or is not an image, or if the sizes of the images differ: the focal length is shared.
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
        if sorted(size) != sorted(expected):
            first = photos.photographs[0].path.name
            raise InputError(
                f"{photo.path}: has {size[0]} x {size[1]} px, allowed is the size of {first}, "
                f"{expected[0]} x {expected[1]} px, or the same size upright"
            )
    return answer_photos(photos, shown, messages)


def answer_photos(
    photos: PhotoSet, shown: Sequence[Shown | None], messages: Mapping[int, str]
) -> PhotosAnswer:
    """Answer for traced photographs; `messages` say why there is no beam in some of them.

    A photograph that no beam with a single load fits is left out of the joint fit, the worst first.
    Photographs that need another EI or length than is stated have no values.
    """
    answers = {i: PhotoAnswer(Outcome.INVALID, text) for i, text in messages.items()}
    fitted = [i for i in range(len(shown)) if i not in messages]
    while fitted:
        part = replace(photos, photographs=tuple(photos.photographs[i] for i in fitted))
        fit = fit_photos(part, [one for i in fitted if (one := shown[i]) is not None])
        if fit is None:
            break
        misfits = [one.misfit if not one.fits else 0.0 for one in fit.fits]
        contradiction = contradicted_statement(fit) if not any(misfits) else ""
        if contradiction:
            answers |= {i: PhotoAnswer(Outcome.INVALID, contradiction) for i in fitted}
            break
        if not any(misfits):
            own = [photo_answer(fit, part, i) for i in range(len(fitted))]
            answers |= dict(zip(fitted, own, strict=True))
            return PhotosAnswer(
                photos=photos,
                answers=tuple(answers[i] for i in range(len(shown))),
                shared=shared_values(fit, part) if fit.converged else {},
                notes=tuple(notes_of(fit, part, own)) if fit.converged else (),
                shown=tuple(shown),
                fitted=tuple(fitted),
                fit=fit,
            )
        worst = misfits.index(max(misfits))
        answers[fitted[worst]] = photo_answer(fit, part, worst)
        del fitted[worst]
    failed = PhotoAnswer(Outcome.NOT_CONVERGED, Outcome.NOT_CONVERGED.sentence)
    return PhotosAnswer(
        photos=photos,
        answers=tuple(answers.get(i, failed) for i in range(len(shown))),
        shared={},
        notes=(),
        shown=tuple(shown),
        fitted=(),
        fit=None,
    )
