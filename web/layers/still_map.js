// Leaflet drops every view that it is given while it zooms: who asks then would wait for ever.

/** Calls `work()` with the next frame or, where the map zooms, when the zoom has ended. */
export function whenStill(map, work) {
  // A zoom that was asked for just now begins with the next frame.
  requestAnimationFrame(() => {
    if (map.getPane('mapPane').classList.contains('leaflet-zoom-anim')) {
      map.once('zoomend', () => whenStill(map, work));
    } else {
      work();
    }
  });
}
