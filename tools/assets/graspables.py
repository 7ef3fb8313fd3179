"""Build the graspable objects: ``python -m tools.assets.graspables`` writes ``urdf/graspables``.

Every model has one link, ``base``: origin at the bottom centre, z up, x along the longest horizontal side, the face
with the label towards -y. Metres, kilograms. The same code writes the same bytes on every run.
"""

from collections.abc import Callable
from pathlib import Path

from chmarl_pb.assets import URDF_DIR
from tools.assets import graspables_bath as bath
from tools.assets import graspables_desk as desk
from tools.assets import graspables_food as food
from tools.assets import graspables_home as home
from tools.assets import graspables_kitchen as kitchen
from tools.assets.model import Model, Paint, write_model

FOLDER = URDF_DIR / "graspables"

#: Builder, named after its class, and mass in kilograms.
ROWS: tuple[tuple[Callable[[], Paint], float], ...] = (
    (food.apple, 0.18),
    (food.banana, 0.15),
    (desk.board_game, 0.9),
    (desk.book, 0.45),
    (kitchen.bowl, 0.35),
    (food.bread, 0.5),
    (home.candle, 0.3),
    (food.cereal_box, 0.4),
    (food.chocolate_syrup, 0.6),
    (home.clock, 0.4),
    (kitchen.coffee_pot, 0.9),
    (kitchen.cooking_pot, 1.6),
    (food.cupcake, 0.1),
    (home.cushion, 0.5),
    (bath.face_cream, 0.15),
    (desk.folder, 0.25),
    (kitchen.fork, 0.06),
    (kitchen.frying_pan, 1.0),
    (kitchen.glass, 0.35),
    (bath.hairbrush, 0.12),
    (food.juice_box, 0.22),
    (kitchen.knife, 0.15),
    (food.lime, 0.07),
    (bath.lotion, 0.3),
    (desk.magazine, 0.25),
    (food.milk_carton, 1.05),
    (desk.mobile_phone, 0.18),
    (kitchen.mug, 0.45),
    (desk.notes, 0.15),
    (food.peach, 0.16),
    (kitchen.plate, 0.5),
    (desk.remote_control, 0.12),
    (bath.shampoo, 0.35),
    (bath.slippers, 0.35),
    (home.sports_ball, 0.42),
    (home.teddy_bear, 0.4),
    (bath.toothbrush, 0.03),
    (bath.toothpaste, 0.12),
    (bath.towel, 0.35),
    (home.toy_car, 0.15),
    (kitchen.washing_sponge, 0.03),
    (food.water_bottle, 0.52),
    (food.whipped_cream, 0.35),
    (food.wine_bottle, 1.2),
    (kitchen.wine_glass, 0.3),
)


def models() -> list[Model]:
    """Return all graspable models."""
    return [Model(builder.__name__, mass, builder()) for builder, mass in ROWS]


def build(folder: Path = FOLDER) -> list[Path]:
    """Write every model into a folder, remove files of earlier builds and return the URDF paths."""
    built = models()
    for old in (*folder.glob("*.urdf"), *folder.glob("meshes/*.obj")):
        old.unlink()
    return [write_model(model, folder) for model in built]


if __name__ == "__main__":
    print(f"wrote {len(build())} models to {FOLDER}")
