// SPDX-License-Identifier: MIT
using System;

namespace SplatBus
{
    /// <summary>Takes a `frame` out of a payload into one that is used again, and allocates nothing but names that are new.</summary>
    static class Frames
    {
        internal static Frame Empty()
        {
            return new Frame { Camera = new FrameCamera { Position = new double[3], Rotation = new double[4] } };
        }

        /// <summary>What names the image and its place [IMG-15].</summary>
        internal static bool ReadPlace(JsonValue message, out long generation, out long seq, out long slot)
        {
            generation = seq = slot = 0;
            JsonValue member;
            return message.TryMember("generation", out member) && member.TryInteger(out generation)
                && message.TryMember("seq", out member) && member.TryInteger(out seq)
                && message.TryMember("slot", out member) && member.TryInteger(out slot);
        }

        /// <summary>Fill in all the rest.</summary>
        /// <returns>What breaks a rule, or null.</returns>
        internal static string Read(JsonValue message, Meta meta, Frame to)
        {
            JsonValue camera, objects;
            double time, renderedAt;
            if (!Number(message, "time", out time) || !Number(message, "renderedAt", out renderedAt)) return "a frame without time or renderedAt [IMG-1]";
            to.Time = time;
            to.RenderedAt = renderedAt;
            if (!message.TryMember("camera", out camera)) return "a frame without camera [IMG-1]";
            string wrong = ReadCamera(camera, meta, to.Camera);
            if (wrong != null) return wrong;
            if (message.TryMember("objects", out objects)) return ReadObjects(objects, to);
            to.Objects = null;
            return null;
        }

        static string ReadCamera(JsonValue camera, Meta meta, FrameCamera to)
        {
            double fx, fy, cx, cy, near, far;
            JsonValue width, height, tag;
            if (!ReadPose(camera, to.Position, to.Rotation)) return "a frame whose camera has no pose [IMG-1, POS-2, POS-3]";
            if (!Number(camera, "fx", out fx) || !Number(camera, "fy", out fy) || fx <= 0 || fy <= 0) return "a frame whose camera has no focal length [IMG-1]";
            if (!Number(camera, "cx", out cx) || !Number(camera, "cy", out cy)) return "a frame whose camera has no principal point [IMG-1]";
            if (!Number(camera, "near", out near) || !Number(camera, "far", out far) || near <= 0 || near >= far) return "a frame whose camera has no clipping planes [IMG-1]";
            if (!camera.TryMember("width", out width) || width.Number != meta.W || !camera.TryMember("height", out height) || height.Number != meta.H)
                return "a frame whose camera has another size than the init packet [IMG-1]";
            to.Fx = fx;
            to.Fy = fy;
            to.Cx = cx;
            to.Cy = cy;
            to.Near = near;
            to.Far = far;
            to.Width = meta.W;
            to.Height = meta.H;
            if (!camera.TryMember("tag", out tag)) to.Tag = null;
            else if (tag.Kind != JsonKind.String) return "a frame whose tag is no string [CAM-3]";
            else if (to.Tag == null || !tag.Is(to.Tag)) to.Tag = tag.Text;
            return null;
        }

        static string ReadObjects(JsonValue objects, Frame to)
        {
            if (objects.Kind != JsonKind.Array || objects.Count > Limits.MaxObjects) return "a frame whose objects are no array of at most 256 [OBJ-7]";
            if (to.Objects == null || to.Objects.Length != objects.Count) to.Objects = NewPlacements(objects.Count);
            int at = 0;
            foreach (JsonValue each in objects)
            {
                Placement placement = to.Objects[at];
                JsonValue name;
                double scale;
                if (!each.TryMember("object", out name) || name.Kind != JsonKind.String) return "a frame with an object without a name [OBJ-7]";
                if (!ReadPose(each, placement.Position, placement.Rotation)) return "a frame with an object without a pose [OBJ-7]";
                if (!Number(each, "scale", out scale) || scale <= 0) return "a frame with an object without a scale [OBJ-7]";
                placement.Scale = scale;
                if (placement.Object == null || !name.Is(placement.Object)) placement.Object = name.Text;
                for (int other = 0; other < at; other++) if (to.Objects[other].Object == placement.Object) return "a frame that names an object twice [OBJ-7]";
                at++;
            }
            return null;
        }

        static Placement[] NewPlacements(int count)
        {
            var placements = new Placement[count];
            for (int i = 0; i < count; i++) placements[i] = new Placement { Position = new double[3], Rotation = new double[4] };
            return placements;
        }

        /// <summary>A pose in arrays, as POS-2 and POS-3 say.</summary>
        internal static bool ReadPose(JsonValue of, double[] position, double[] rotation)
        {
            JsonValue p, q;
            return of.TryMember("position", out p) && p.TryNumbers(position) && of.TryMember("rotation", out q) && q.TryNumbers(rotation)
                && Pose.Of(position, rotation).Wrong == null;
        }

        static bool Number(JsonValue of, string name, out double value)
        {
            JsonValue member;
            bool found = of.TryMember(name, out member) && member.Kind == JsonKind.Number;
            value = found ? member.Number : 0;
            return found;
        }
    }
}
