"""Training, exporting and rendering of change detection end to end, on generated pictures: resume, refusals, OpenCV against torch."""

import tempfile
import unittest
from pathlib import Path

import numpy as np
import onnx
import torch

import export_change
import predict_change
import simulate_change
import train_change
import train_change_surroundings
from common import training
from change import data, onnx_model
from change.manifest import read_manifest
from change.exported import load_exported
from change.network import ChangeNetwork, ThesisNetwork
from change.surroundings import UNSEEN_CHANGE
from detector.manifest import ManifestError

from .synthetic_change import street, write_pair, write_photos, write_streets
from .programs import quietly

SIMULATOR = Path(__file__).resolve().parents[2] / "install/lib/livemap/livemap_simulate"


@torch.no_grad()
def shake(network):
    """Weights that are trained, each moved a little."""
    for weight in network.parameters():
        if weight.requires_grad:
            weight += 0.02 * torch.randn_like(weight)


class ChangePrograms(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = Path(cls.folder.name)
        cls.pairs = write_streets(cls.root / "pairs")
        cls.held_out = write_streets(cls.root / "held_out", (3,))
        cls.photos = write_photos(cls.root / "photos")
        cls.threads = torch.get_num_threads()
        cls.validation_photos, train_change.VALIDATION_PHOTOS = train_change.VALIDATION_PHOTOS, 2
        export_change.VALIDATION_PHOTOS = 2

    @classmethod
    def tearDownClass(cls):
        torch.set_num_threads(cls.threads)
        train_change.VALIDATION_PHOTOS = export_change.VALIDATION_PHOTOS = cls.validation_photos
        cls.folder.cleanup()

    def train(self, out, *more):
        """Three tiny epochs: the first pretraining, the last of whole pictures."""
        return quietly(
            train_change, "--pairs", self.pairs, "--validation", self.held_out, "--data", self.photos, "--out", self.root / out,
            "--pretrain", 1, "--epochs", 3, "--samples-per-epoch", 4, "--batch", 2, "--settle", 0.34, "--workers", 0,
            "--threads", 1, "--device", "cpu", "--validate-every", 3, *more,
        )

    def test_a_stopped_run_continues_as_if_it_had_not(self):
        self.assertEqual(self.train("whole"), (0, ""))
        whole = torch.load(self.root / "whole" / "last.pt")
        save = training.save_atomically
        for stop_after in (1, 2):
            def stop(content, path):
                save(content, path)
                if content["epoch"] == stop_after:
                    raise KeyboardInterrupt

            out = f"stopped{stop_after}"
            training.save_atomically = stop
            try:
                with self.assertRaises(KeyboardInterrupt):
                    self.train(out)
            finally:
                training.save_atomically = save
            self.assertEqual(self.train(out, "--resume"), (0, ""))
            continued = torch.load(self.root / out / "last.pt")
            for name, tensor in whole["average"].items():
                torch.testing.assert_close(continued["average"][name], tensor, rtol=0, atol=0, msg=name)
        status, errors = self.train("whole", "--resume", "--learning-rate", 0.5)
        self.assertEqual(status, 2)
        self.assertIn("learning_rate", errors)

    def test_the_surroundings_are_learnt_and_all_else_stays(self):
        start = self.root / "start.pt"
        torch.manual_seed(3)
        before = ChangeNetwork().state_dict()
        torch.save({"settings": {"architecture": "change-small"}, "average": before}, start)

        def learn(out, *more):
            return quietly(
                train_change_surroundings, "--start-from", start, "--pairs", self.pairs, "--validation", self.held_out,
                "--out", self.root / out, "--epochs", 2, "--threads", 1, *more,
            )

        self.assertEqual(learn("around"), (0, ""))
        learnt = torch.load(self.root / "around" / "last.pt")["average"]
        for name, tensor in before.items():
            if not name.startswith("surroundings."):
                torch.testing.assert_close(learnt[name], tensor, rtol=0, atol=0, msg=name)
        self.assertFalse(torch.equal(learnt["surroundings.refiners.0.correction.bias"], before["surroundings.refiners.0.correction.bias"]))
        for fixed in ("surroundings.prior.unseen.weight", "surroundings.weigh.weight"):
            self.assertTrue(torch.equal(learnt[fixed], before[fixed]))
        status, errors = learn("around")
        self.assertEqual((status, errors.count("\n")), (2, 1))
        self.assertIn("--resume", errors)
        self.check_resumed(learn, learnt)

    def check_resumed(self, learn, learnt):
        """A run that was killed after its first epoch ends as the one that was not."""
        save = train_change_surroundings.save_atomically

        def stop(content, path):
            save(content, path)
            if path.name == "last.pt" and content["epoch"] == 1:
                raise KeyboardInterrupt

        train_change_surroundings.save_atomically = stop
        try:
            with self.assertRaises(KeyboardInterrupt):
                learn("stopped_around")
        finally:
            train_change_surroundings.save_atomically = save
        self.assertEqual(learn("stopped_around", "--resume"), (0, ""))
        continued = torch.load(self.root / "stopped_around" / "last.pt")["average"]
        for name, tensor in learnt.items():
            torch.testing.assert_close(continued[name], tensor, rtol=0, atol=0, msg=name)

    def test_exported_graphs_are_torchs(self):
        models = self.root / "models"
        models.mkdir()
        checkpoint = self.root / "random.pt"
        # An untrained network shares equal tensors, which the exporter passes on through Identity nodes.
        torch.manual_seed(1)
        network = ChangeNetwork()
        torch.save({"settings": {"architecture": "change-small"}, "average": network.state_dict()}, checkpoint)
        exported = quietly(
            export_change, "--checkpoint", checkpoint, "--name", "tiny", "--out", models, "--validation", self.held_out,
            "--data", self.photos, "--threads", 1,
        )
        self.assertEqual(exported, (0, ""))
        manifest = read_manifest(models / "tiny.yaml")
        self.assertEqual((manifest.width, manifest.height), (320, 256))
        rng = np.random.default_rng(2)
        first, second = rng.normal(size=(2, 1, 3, 256, 320)).astype(np.float32)
        validity = np.ones((1, 1, 256, 320), np.float32)
        validity[..., 100:, 200:] = 0
        with torch.no_grad():
            expected = network.eval().detect(*map(torch.from_numpy, (first, second, validity))).numpy()
        whole, encoder, head = (onnx_model.OpenCvModel(manifest.files[part]) for part in onnx_model.PARTS)
        found = whole.run({"first": first, "second": second, "validity": validity})[0]
        np.testing.assert_allclose(found, expected, atol=1e-3)
        np.testing.assert_allclose(onnx_model.run_parts(encoder, head, first, second, validity), expected, atol=1e-3)
        np.testing.assert_allclose(found[0, 0, 100:, 200:], 1 - UNSEEN_CHANGE, atol=1e-3)
        self.check_predictions(models / "tiny.yaml", checkpoint)
        for part in onnx_model.PARTS:
            self.assertLess(manifest.files[part].stat().st_size, 10_000_000)
        manifest.files["head"].write_bytes(b"something else")
        with self.assertRaisesRegex(ManifestError, "SHA-256"):
            read_manifest(models / "tiny.yaml")

    def test_an_exported_network_can_be_taken_up_again(self):
        torch.manual_seed(4)
        network = ChangeNetwork(refiners=2).eval()
        shake(network)  # the exporter stores equal tensors once
        onnx_model.export(network, self.root, "kept", ["whole"])
        inputs = [torch.from_numpy(part) for part in onnx_model.golden_inputs()]
        with torch.no_grad():
            taken_up, expected = (one.detect(*inputs) for one in (load_exported(self.root / "kept.onnx"), network))
        torch.testing.assert_close(taken_up, expected, rtol=0, atol=1e-4)

    def test_weights_with_names_of_earlier_versions_are_taken_up(self):
        state = ChangeNetwork().state_dict()
        earlier = {name.replace(".refiners.", ".judges.").replace(".correction.", ".verdict."): value for name, value in state.items()}
        self.assertNotEqual(list(earlier), list(state))
        path = self.root / "earlier.pt"
        torch.save({"settings": {"architecture": "change-small"}, "average": earlier}, path)
        for name, value in export_change.load_averaged(path).state_dict().items():
            self.assertTrue(torch.equal(value, state[name]), name)
        shipped = load_exported(Path(__file__).resolve().parents[2] / "models" / "change-small.onnx")
        self.assertEqual(len(shipped.surroundings.refiners), 3)
        self.assertTrue((shipped.surroundings.refiners[2].correction.weight != 0).any())

    def test_refiners_of_several_runs_give_their_mean_correction(self):
        torch.manual_seed(5)
        base = ChangeNetwork().eval()
        checkpoints, log_odds = [], []
        inputs = [torch.from_numpy(part) for part in onnx_model.golden_inputs()]
        unseen = base.unseen_cells(inputs[2])
        for run in range(3):
            shake(base.surroundings)
            checkpoints.append(self.root / f"refiner{run}.pt")
            torch.save({"settings": {"architecture": "change-small"}, "average": base.state_dict()}, checkpoints[-1])
            with torch.no_grad():
                log_odds.append(base.refined(*map(base.encode, inputs[:2]), unseen))
        joined = export_change.load_ensemble(checkpoints)
        with torch.no_grad():
            found = joined.refined(*map(joined.encode, inputs[:2]), unseen)
        torch.testing.assert_close(found, torch.stack(log_odds).mean(dim=0), rtol=0, atol=1e-4)
        shake(base.encoder)
        torch.save({"settings": {"architecture": "change-small"}, "average": base.state_dict()}, checkpoints[1])
        with self.assertRaisesRegex(export_change.ExportError, "different networks"):
            export_change.load_ensemble(checkpoints)

    def check_predictions(self, manifest, checkpoint):
        """OpenCV and torch write the same for the evaluation, and what cannot be registered was not seen."""
        pairs = self.root / "to_predict"
        first, second, mask = street(4, False, True)
        write_pair(pairs, 0, first, second, mask)
        write_pair(pairs, 1, np.full_like(first, 90), second, mask)
        for name, model in (("opencv", ("--manifest", manifest)), ("torch", ("--checkpoint", checkpoint))):
            arguments = (*model, "--pairs", pairs, "--out", self.root / name, "--threads", 1)
            self.assertEqual(quietly(predict_change, *arguments), (0, ""))
        for order in ("forward", "reversed"):
            found = np.load(self.root / "opencv" / order / "000" / "00.npy")
            self.assertEqual((found.shape, found.dtype), ((10, 256, 320), np.float32))
            np.testing.assert_allclose(found, np.load(self.root / "torch" / order / "000" / "00.npy"), atol=1e-3)
            np.testing.assert_allclose(np.load(self.root / "opencv" / order / "000" / "01.npy")[0], 1 - UNSEEN_CHANGE, atol=1e-3)

    def test_predictions_have_the_size_of_the_pictures(self):
        ramp = np.tile(np.linspace(0, 1, 320, dtype=np.float32), (10, 256, 1))
        enlarged = predict_change.enlarge(ramp, 640, 480)
        self.assertEqual(enlarged.shape, (10, 480, 640))
        np.testing.assert_allclose(enlarged[0, 470, [0, 639]], [0, 1], atol=2e-3)

    def test_the_thesis_network_trains_and_is_exported_too(self):
        original = train_change.ARCHITECTURES["thesis"]
        train_change.ARCHITECTURES["thesis"] = lambda: ThesisNetwork(base=4)
        try:
            self.assertEqual(self.train("thesis", "--architecture", "thesis", "--precision", "fp32"), (0, ""))
            network = export_change.load_averaged(self.root / "thesis" / "last.pt")
        finally:
            train_change.ARCHITECTURES["thesis"] = original
        onnx_model.export(network, self.root, "thesis", ("whole",))
        first, second, validity = onnx_model.golden_inputs()
        with torch.no_grad():
            expected = network.detect(*map(torch.from_numpy, (first, second, validity))).numpy()
        found = onnx_model.OpenCvModel(self.root / "thesis.onnx").run({"first": first, "second": second, "validity": validity})[0]
        np.testing.assert_allclose(found, expected, atol=1e-3)

    def test_the_pass_for_opencv_removes_identities_and_constants(self):
        node, value = onnx.helper.make_node, onnx.numpy_helper.from_array(np.float32([3]), "")
        graph = onnx.helper.make_graph(
            [node("Constant", [], ["c"], value=value), node("Identity", ["w"], ["v"]), node("Identity", ["v"], ["u"]),
             node("Add", ["x", "u"], ["s"]), node("Mul", ["s", "c"], ["y"])],
            "g", [onnx.helper.make_tensor_value_info("x", 1, [1])], [onnx.helper.make_tensor_value_info("y", 1, [1])],
            [onnx.numpy_helper.from_array(np.float32([2]), "w")],
        )
        model = onnx_model.for_opencv(onnx.helper.make_model(graph))
        self.assertEqual([(n.op_type, list(n.input)) for n in model.graph.node], [("Add", ["x", "w"]), ("Mul", ["s", "c"])])
        onnx.checker.check_graph(model.graph)

    def test_refusals_are_one_sentence_and_status_2(self):
        nowhere = self.root / "nowhere"
        photos_alone = self.root / "no_scenes"
        write_streets(photos_alone)
        for path in photos_alone.glob("*/all/raw/*/GT/*.png"):
            path.unlink()
        cases = [
            (train_change, ("--pairs", nowhere, "--out", self.root / "new")),
            (train_change, ("--pairs", photos_alone, "--out", self.root / "new")),
            (train_change, ("--epochs", 0)),
            (train_change, ("--pretrain", 90)),
            (train_change, ("--start-from", nowhere, "--out", self.root / "new")),
            (train_change, ("--frobnicate",)),
            (export_change, ("--checkpoint", nowhere, "--out", self.root)),
            (export_change, ("--out", nowhere)),
            (predict_change, ("--pairs", self.pairs, "--out", self.root / "new")),
            (predict_change, ("--pairs", self.pairs, "--out", self.root / "new", "--manifest", nowhere)),
            (simulate_change, ("--program", nowhere, "--out", self.root / "new")),
        ]
        for program, arguments in cases:
            status, errors = quietly(program, *arguments)
            self.assertEqual(status, 2, arguments)
            self.assertNotIn("Traceback", errors)
            self.assertTrue(errors.strip(), arguments)

    @unittest.skipUnless(SIMULATOR.is_file(), "skipped, the simulator is not built")
    def test_the_simulator_renders_what_training_reads(self):
        out = self.root / "rendered"
        arguments = ("--program", SIMULATOR, "--out", out, "--first-seed", 7, "--worlds", 1, "--pairs", 1, "--jobs", 1)
        self.assertEqual(quietly(simulate_change, *arguments), (0, ""))
        pairs = {pair.name.split("/")[1]: pair for pair in data.read_pairs(out)}
        self.assertEqual(set(pairs), {"some", "none", "all"})
        self.assertFalse((pairs["none"].mask % data.IGNORED).any())
        self.assertEqual(len(pairs["all"].fallbacks), len(data.PLANE_DEPTHS_M))
        self.assertEqual(len(data.read_scenes(out)), 1)


if __name__ == "__main__":
    unittest.main()
