#!/usr/bin/python3
"""Very many hazards in real Chromium: the page draws and lists what is seen, and nothing is lost. How fast that is
measures `./livemap bench page`.

  map_page_scale_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import sys

from map_page_fixture import LAT, LON, Keys, MapPage, run_tests

MAX_SIGNS = 150
MAX_NODES = 1500


class Desktop(MapPage):
    def open_filled(self, count):
        self.assertEqual(self.zone.do("fill", count=count, lat=LAT, lon=LON)["hazards"], count)
        self.open()
        self.wait(lambda: self.find("#list-count").text == f"{count:,}", "not all are listed")
        self.wait_for("#map .sign")

    def drawn(self):
        """How many hazards the signs stand for."""
        return self.browser.execute_script("""
            const rings = [...document.querySelectorAll('#map .cluster')].map((ring) => Number(ring.textContent.replace(',', '')));
            return document.querySelectorAll('#map .pin').length + rings.reduce((sum, count) => sum + count, 0);""")

    def assert_small(self):
        self.assertLessEqual(self.count("#map .sign"), MAX_SIGNS)
        self.assertLess(self.count("*"), MAX_NODES)

    def zoom(self, direction):
        self.wait_still()  # Leaflet drops a click while it zooms.
        before = self.scale()
        self.browser.execute_script(
            "document.querySelector('.leaflet-control-zoom-' + arguments[0]).click()", direction)
        self.wait(lambda: self.scale() != before, "the map does not zoom")

    def scale(self):
        return self.find(".leaflet-control-scale-line").text, self.count(".leaflet-zoom-anim")

    def test_ten_thousand_hazards_are_few_nodes_at_every_zoom_and_all_of_them_are_drawn(self):
        self.open_filled(9000)
        self.click(".fit-control button")
        self.wait(lambda: self.drawn() == 9000, f"the signs stand for {self.drawn()} hazards")
        self.assert_small()
        self.picture("ten_thousand")
        # No nearer: the view would be an empty block between two streets.
        for direction in ["in"] * 3 + ["out"] * 6:
            self.zoom(direction)
            self.wait(lambda: self.drawn() > 0, "nothing is drawn")
            self.assert_small()
        self.wait(lambda: self.drawn() == 9000, f"from afar the signs stand for {self.drawn()} hazards")
        hazard = self.find("#hazard-list button").get_attribute("data-hazard")
        self.open_popup_of(hazard)
        self.picture("ten_thousand_near")
        self.assert_small()
        self.assert_quiet()

    def test_all_of_ten_thousand_hazards_are_in_the_list_and_few_of_them_in_the_document(self):
        self.open_filled(10000)
        self.assertLess(self.count("#hazard-list button"), 60)
        self.browser.execute_script("document.querySelector('#hazard-list button').focus()")
        self.press(Keys.END)
        self.wait(lambda: self.focused_number() == "10000", "End does not go to the last")
        self.assertLess(self.count("#hazard-list button"), 60)
        self.press(Keys.ARROW_UP)
        self.wait(lambda: self.focused_number() == "9999", "the arrow does not move")
        self.press(Keys.HOME)
        self.wait(lambda: self.focused_number() == "1", "Home does not go to the first")
        # Each row stands once, at its place.
        for top in (0, 100000, 333333):
            self.browser.execute_script("document.getElementById('hazard-list').scrollTop = arguments[0]", top)
            self.wait(lambda: self.rows_cover_the_list(), f"rows are missing at {top}")
        self.assert_quiet()

    def focused_number(self):
        return self.browser.execute_script(
            "return document.activeElement.parentElement.getAttribute('aria-posinset')")

    def rows_cover_the_list(self):
        return self.browser.execute_script("""
            const list = document.getElementById('hazard-list').getBoundingClientRect();
            const rows = [...document.querySelectorAll('#hazard-list button')]
              .map((row) => row.getBoundingClientRect())
              .filter((row) => row.bottom > list.top && row.top < list.bottom).sort((a, b) => a.top - b.top);
            return rows.length > 2 && rows[0].top <= list.top && rows[rows.length - 1].bottom >= list.bottom
              && rows.every((row, i) => i === 0 || Math.abs(row.top - rows[i - 1].bottom) < 1);""")

    def test_what_one_reads_in_the_list_stays_when_a_new_hazard_comes(self):
        for step in range(40):
            self.zone.report("pothole", LAT + 0.001 * step, LON, picture=False)
        self.open()
        self.wait(lambda: self.find("#list-count").text == "40", "not all are listed")
        self.browser.execute_script("document.getElementById('hazard-list').scrollTop = 560")
        self.wait(self.rows_cover_the_list, "rows are missing")
        read, top = self.first_row()
        self.zone.report("deer", LAT, LON + 0.01, picture=False)
        self.wait(lambda: self.find("#list-count").text == "41", "the new one is not listed")
        self.wait(lambda: self.first_row() == [read, top], "the row moved")

    def first_row(self):
        return self.browser.execute_script("""
            const list = document.getElementById('hazard-list').getBoundingClientRect();
            const seen = [...document.querySelectorAll('#hazard-list button')]
              .filter((row) => row.getBoundingClientRect().top >= list.top - 1)
              .sort((a, b) => a.getBoundingClientRect().top - b.getBoundingClientRect().top)[0];
            return [seen.dataset.hazard, Math.round(seen.getBoundingClientRect().top - list.top)];""")

    def test_a_filter_counts_and_hides_among_ten_thousand(self):
        self.open_filled(9000)
        debris = self.find("#filter .chip:has([data-class=debris]) .count").text
        self.click('#filter [data-class="debris"]')
        rest = 9000 - int(debris.replace(",", ""))
        self.wait(lambda: self.find("#list-count").text == f"{rest:,}", "the filter does nothing")
        self.click(".fit-control button")
        self.wait(lambda: self.drawn() == rest, "what is hidden is drawn")
        self.assert_quiet()

    def test_classes_that_vehicles_invent_share_one_box(self):
        for number in range(120):
            self.zone.report(f"spam {number}", LAT + 0.0003 * number, LON, picture=False)
        self.zone.report("pothole", LAT, LON, picture=False)
        self.open()
        self.wait(lambda: self.find("#list-count").text == "121", "not all are listed")
        self.assertEqual(self.count("#filter li"), 2)
        self.assertEqual(self.find('#filter .chip:has([data-class=""]) .count').text, "120")
        self.assertIn("Other kinds", self.find("#filter").text)
        self.click('#filter [data-class=""]')
        self.wait(lambda: self.find("#list-count").text == "1", "the box does not hide them")
        self.zone.report("spam 200", LAT - 0.01, LON, picture=False)
        self.wait(lambda: self.find('#filter .chip:has([data-class=""]) .count').text == "121", "not counted")
        self.assertEqual(self.find("#list-count").text, "1")
        self.click("#filter-none")
        self.wait(lambda: self.find("#list-count").text == "0", "none is not none")
        self.zone.report("deer", LAT - 0.02, LON, picture=False)
        self.wait_for("#filter [data-class=deer]")
        self.assertEqual(self.find("#list-count").text, "0")
        self.click("#filter-all")
        self.wait(lambda: self.find("#list-count").text == "123", "all is not all")
        self.assert_quiet()

    def test_a_ring_zooms_to_what_it_stands_for_and_the_focus_stays_on_a_sign(self):
        self.open_filled(1000)
        self.click(".fit-control button")
        self.wait(lambda: self.drawn() == 1000 and self.count(".leaflet-zoom-anim") == 0, "not all are drawn")
        for _ in range(2):
            before = self.scale()
            self.browser.execute_script("document.querySelector('.cluster[tabindex=\"0\"]').focus()")
            self.press(Keys.ENTER)
            self.wait(lambda: self.scale() != before and self.count(".leaflet-zoom-anim") == 0, "it does not zoom")
            self.wait(lambda: self.browser.execute_script(
                "return document.activeElement.classList.contains('sign')"), "the focus is lost")
        # The signs of the new view come after the zoom, in slices.
        self.wait(lambda: self.drawn() < 1000, "the rings that were left are drawn still")
        self.assert_quiet()

    def test_what_no_zoom_parts_is_listed_by_its_ring(self):
        for name in ("pothole", "debris", "deer"):
            self.zone.report(name, LAT, LON, picture=False)
        self.open()
        self.wait_for('.cluster[tabindex="0"]')
        self.browser.execute_script("document.querySelector('.cluster').focus()")
        self.press(Keys.ENTER)
        self.wait_for_text(".popup", "3 hazards here", "Pothole", "Debris", "Deer")
        self.assertEqual(self.count(".popup .here button"), 3)
        self.wait(lambda: self.browser.execute_script(
            "return document.activeElement.classList.contains('popup')"), "the list has no focus")
        self.picture("ring_list")
        self.click(".popup .here li:nth-child(2) button")
        self.wait_for_text(".popup[data-hazard]", "Debris")
        self.assert_quiet()

    def test_a_question_that_fails_does_not_end_the_next_ones(self):
        self.open()
        asked = self.browser.execute_async_script("""
            const done = arguments[0];
            import(new URL('dom.js', document.baseURI)).then(async ({ oneAtATime }) => {
              const asked = [];
              const ask = oneAtATime(async () => {
                asked.push(asked.length);
                await null;
                if (asked.length === 1) throw new Error('as meant');
              });
              await ask().catch(() => {});
              ask();
              ask();
              await ask();
              setTimeout(() => done(asked));
            });""")
        self.assertEqual(asked, [0, 1, 2], "calls during a run are one more run")

    def test_signs_are_drawn_in_slices_between_which_the_page_answers(self):
        self.open_filled(2000)
        self.click(".fit-control button")
        self.wait(lambda: self.drawn() == 2000, "not all are drawn")
        self.browser.execute_script("""
            // A page that is slow: each sign takes longer than a slice may.
            const draw = Element.prototype.setAttribute;
            Element.prototype.setAttribute = function (...what) {
              if (what[0] === 'aria-label' && this.closest('#map') === null) {
                for (const end = performance.now() + 9; performance.now() < end;);
              }
              return draw.apply(this, what);
            };
            window.most = 0;
            new MutationObserver((changes) => {
              const added = changes.flatMap((change) => [...change.addedNodes])
                .filter((node) => node.classList?.contains('sign')).length;
              window.most = Math.max(window.most, added);
            }).observe(document.querySelector('.leaflet-marker-pane'), { childList: true });""")
        self.zoom("in")
        self.wait(lambda: self.count("#map .sign") > 10 and self.count(".leaflet-zoom-anim") == 0, "nothing is drawn")
        self.assertLessEqual(self.browser.execute_script("return window.most"), 2)

    def test_a_burst_of_new_hazards_is_few_rings_that_spread(self):
        self.zone.report("pothole", LAT, LON, picture=False)
        self.open()
        self.browser.execute_script("""
            window.most = 0;
            const pane = document.querySelector('.leaflet-marker-pane');
            new MutationObserver(() => {
              window.most = Math.max(window.most, pane.querySelectorAll('.pulse').length);
            }).observe(pane, { childList: true });""")
        for number in range(60):
            self.zone.report("deer", LAT + 0.0003 * (number % 8), LON + 0.0004 * (number // 8 + 1), picture=False)
        self.wait(lambda: self.find("#list-count").text == "61", "not all are listed")
        most = self.browser.execute_script("return window.most")
        self.assertLessEqual(most, 20)
        self.assertGreater(most, 0)
        self.assert_quiet()

    def test_a_zone_that_is_back_is_looked_for_every_second(self):
        self.open()
        delays = self.browser.execute_async_script("""
            const done = arguments[0];
            import(new URL('worker/live_feed.js', document.baseURI)).then(({ LiveFeed }) => {
              const asked = [];
              const real = window.setTimeout;
              window.setTimeout = (work, delay) => { asked.push(delay); return 0; };
              const feed = new LiveFeed({ onState() {} });
              for (let i = 0; i < 30; i += 1) feed.retryLater();
              window.setTimeout = real;
              done(asked);
            });""")
        self.assertEqual(len(delays), 30)
        self.assertLessEqual(max(delays), 1250)
        self.assertGreater(len(set(delays)), 20, "all pages would ask at the same moments")


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
