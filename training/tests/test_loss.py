"""Label assignment and loss on a 64x64 input: 256 + 64 + 16 anchor points."""

import unittest
from dataclasses import fields

import torch

from detector.loss import OTHER_CLASS_WEIGHT, Assignment, Target, TargetBatch, TaskAlignedLoss, complete_iou
from detector.network import anchor_points, decode_boxes

BOX = torch.tensor([[16.0, 16.0, 40.0, 32.0]])
NOTHING = torch.zeros(0, 4)


def target(boxes=BOX, ignored=NOTHING, labelled=(1.0, 0.0)):
    """A target of class 0."""
    return Target(boxes, torch.zeros(len(boxes), dtype=torch.int64), ignored, torch.tensor(labelled))


class Assignments(unittest.TestCase):
    def setUp(self):
        self.loss = TaskAlignedLoss(64, 64, torch.device("cpu"))
        self.grid, self.strides = anchor_points(64, 64)
        raw = torch.tensor([0.5, 0.5, 1.6, 1.1]).expand(len(self.grid), 4)
        self.boxes = decode_boxes(raw, self.grid, self.strides)
        self.scores = torch.full((len(self.grid), 2), 0.1)

    def assign(self, target_of_image):
        """The assignment of one image."""
        every = self.loss.assign(self.scores[None], self.boxes[None], TargetBatch.of([target_of_image]))
        return Assignment(*(getattr(every, field.name)[0] for field in fields(every)))

    def test_positives_lie_inside_and_are_few(self):
        assignment = self.assign(target())
        centres = self.loss.centres[assignment.positive]
        self.assertTrue(0 < len(centres) <= 10)
        reach = torch.maximum(torch.tensor([12.0, 8.0]), self.strides[assignment.positive][:, None])
        self.assertTrue(((centres - torch.tensor([28.0, 24.0])).abs() < reach).all())

    def test_best_point_learns_its_overlap(self):
        self.boxes[100] = BOX[0] + torch.tensor([0.0, 0.0, 0.0, 4.0])  # IoU 16 / 20
        self.loss.centres[100] = torch.tensor([28.0, 24.0])
        assignment = self.assign(target())
        self.assertAlmostEqual(assignment.scores[100, 0].item(), 0.8, places=5)
        self.assertAlmostEqual(assignment.scores.max().item(), 0.8, places=5)

    def test_a_label_smaller_than_a_cell_is_assigned(self):
        tiny = torch.tensor([[30.5, 30.5, 31.5, 31.5]])
        self.assertTrue(self.assign(target(tiny)).positive.any())

    def test_unlabelled_class_and_ignored_regions_are_not_judged(self):
        ignored = torch.tensor([[48.0, 48.0, 64.0, 64.0]])
        assignment = self.assign(target(ignored=ignored))
        weights = assignment.weights
        self.assertEqual(weights[~assignment.positive, 1].sum().item(), 0)
        # An object that is labelled as of one class is none of the other, little as that counts.
        self.assertTrue((weights[assignment.positive, 1] == OTHER_CLASS_WEIGHT).all())
        self.assertEqual(assignment.scores[:, 1].sum().item(), 0)
        inside = (self.loss.centres > 48).all(dim=1)
        self.assertEqual(weights[inside, 0].sum().item(), 0)
        self.assertTrue((weights[~inside, 0] == 1).all())

    def test_empty_image_has_only_background(self):
        assignment = self.assign(target(NOTHING))
        self.assertFalse(assignment.positive.any())
        self.assertEqual(assignment.scores.sum().item(), 0)

    def test_images_of_a_batch_do_not_see_each_others_labels(self):
        pair = torch.tensor([[16.0, 16.0, 40.0, 32.0], [8.0, 40.0, 30.0, 60.0]])
        targets = [target(), target(NOTHING), target(pair, ignored=BOX)]
        together = self.loss.assign(
            self.scores.expand(3, -1, -1), self.boxes.expand(3, -1, -1), TargetBatch.of(targets))
        for image, alone in enumerate(map(self.assign, targets)):
            self.assertTrue(torch.equal(together.scores[image], alone.scores))
            self.assertTrue(torch.equal(together.weights[image], alone.weights))
            self.assertTrue(torch.equal(together.positive[image], alone.positive))
            self.assertTrue(torch.equal(together.boxes[image][alone.positive], alone.boxes[alone.positive]))


class Losses(unittest.TestCase):
    def test_complete_iou(self):
        self.assertAlmostEqual(complete_iou(BOX, BOX).item(), 1.0, places=5)
        # Shifted by 24 px, side by side: IoU 0, centre distance 24^2 over a hull of 48 x 16.
        self.assertAlmostEqual(
            complete_iou(BOX, BOX + torch.tensor([24.0, 0, 24, 0])).item(), -(24**2) / (48**2 + 16**2), places=5
        )

    def test_descends(self):
        torch.manual_seed(1)
        loss_of = TaskAlignedLoss(64, 64, torch.device("cpu"))
        raw = torch.zeros(1, 336, 6, requires_grad=True)
        optimizer = torch.optim.Adam([raw], lr=0.1)
        first = last = sum(loss_of(raw, TargetBatch.of([target()])))
        for _ in range(60):
            optimizer.zero_grad()
            last.backward()
            optimizer.step()
            last = sum(loss_of(raw, TargetBatch.of([target()])))
        self.assertLess(last.item(), 0.2 * first.item())

    def test_batch_without_labels(self):
        losses = TaskAlignedLoss(64, 64, torch.device("cpu"))(torch.zeros(2, 336, 6), TargetBatch.of([target(NOTHING)] * 2))
        self.assertEqual(losses[0].item(), 0)
        self.assertTrue(torch.isfinite(losses[1]))


if __name__ == "__main__":
    unittest.main()
